"""The two figures of docs/measuring.md, on the default scene.

python studies/measuring.py    writes both into docs/

A balance: the phase-locked loop under a constant drive, period by period. The amplitude A still varies, but less the
integral of g E cos(phi) and the slope's term it is a straight line, whose slope is -g E_R. The backbone: E_R(A) and
the frequency of phase resonance from held levels, with the exact orbits. In units of the half-width b and of omega0.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from styles import EXACT, MEASURED, THEORY

import vines

DOCS = Path(__file__).parent.parent / "docs"
PERIODS = 260
WINDOW = slice(70, 130)

scene = vines.Scene()
plant, lock = vines.Plant(scene), vines.PhaseLock(scene)
settings = scene.settings["plant"]
omega0, b = np.sqrt(settings["k"] / settings["M"]), settings["b"]
output = lock.sample(plant.v)
turns, rows, samples = 0.0, [], []
while len(rows) < PERIODS:
    samples.append((turns, plant.v, output.amplitude, output.omega))
    plant.advance(lock.sample_time, amplitude=output.amplitude, omega=output.omega)
    turns += output.omega * lock.sample_time / (2 * np.pi)
    output = lock.sample(plant.v)
    if np.floor(turns) > np.floor(samples[-1][0]):
        phase, v, drive, omega = np.array(samples).T
        basis = np.exp(2j * np.pi * phase)
        columns = np.column_stack([basis.real, basis.imag, np.ones(len(v))])
        cosine, sine, _ = np.linalg.lstsq(columns, v, rcond=None)[0]
        z = 1j * (cosine - 1j * sine)  # v = Re(-i z exp(i phase)): at phase resonance z is -i A
        rows.append((abs(z), np.angle(1j * z), drive.mean(), omega.mean(), len(v) * lock.sample_time))
        samples = []
amplitude, error, drive, omega, duration = np.array(rows).T[:, WINDOW]
rate = omega0**2 / (2 * omega)
time = np.cumsum(duration) * omega0 / (2 * np.pi)


def integral(values: np.ndarray) -> np.ndarray:
    """Integrate over the periods by the trapezoidal rule."""
    steps = 0.5 * (values[1:] + values[:-1]) * 0.5 * (duration[1:] + duration[:-1])
    return np.concatenate([[0.0], np.cumsum(steps)])


work = integral(rate * drive * np.cos(error))
deviation = integral(amplitude - amplitude.mean())
balance = amplitude - work
columns = np.column_stack([np.ones_like(time), integral(rate), deviation])
coefficients = np.linalg.lstsq(columns, balance, rcond=None)[0]
residual = balance - columns @ coefficients
figure, axes = plt.subplots(3, sharex=True, figsize=(7.9, 6))
axes[0].plot(time, amplitude / b, ".", color=MEASURED)
axes[0].set(ylabel="A / b", title="A varies …")
axes[1].plot(time, (balance - coefficients[2] * deviation) / b, ".", color=MEASURED)
axes[1].plot(time, (columns[:, :2] @ coefficients[:2]) / b, color=THEORY, lw=1)
axes[1].set(ylabel="balance / b", title=f"… its balance is a line: $E_R$ = {-coefficients[1]:.3e} m")
axes[2].plot(time, 1e3 * residual / b, ".", color=MEASURED)
axes[2].set(ylabel="rest / (b/1000)", xlabel="periods")
figure.savefig(DOCS / "measuring-balance.svg", metadata={"Date": None})

points = vines.backbone().points
levels = np.column_stack([points["C"], points["sigma"], points["G"]])
exact = levels - np.column_stack([0 * points["C"], points["sigma_difference"], points["G_difference"]])
measured, mean = -coefficients[1] / (scene.dimensionless["epsilon"] * b), amplitude.mean() / b
expected = np.interp(mean, exact[::-1, 0], exact[::-1, 2])
print(f"G = {measured:.5f} at C = {mean:.4f}, exact orbit {expected:.5f}; rest at most {abs(residual).max() / b:.1e} b")
figure, axes = plt.subplots(1, 2, figsize=(7.9, 3.6))
for axis, column, label in zip(axes, (2, 1), ("drive $E_R$ / (ε b)", "detuning of $ω_R$"), strict=True):
    axis.plot(exact[:, 0], exact[:, column], color=EXACT, label="exact orbits")
    axis.plot(levels[:, 0], levels[:, column], ".", color=MEASURED, label="held levels")
    axis.set(xlabel="A / b", ylabel=label)
axes[0].legend()
figure.savefig(DOCS / "measuring-backbone.svg", metadata={"Date": None})
