# %% [markdown]
# # The figures of the study
# Figure 2, the slow invariant manifold with the decay on it; Figures 3 and 5, backbones over the restitution, by theory
# and measured with noise; Figure 4, the way to the lock.

# %%
import matplotlib.pyplot as plt
import numpy as np

import vines

plt.style.use("vines.figures")
scene = vines.Scene()
theory, found = vines.theory(scene), vines.identify(scene)
r = scene.dimensionless["r"]
R = (1 - r) / (1 + r)
print(f"fold at B = {theory.B_min:.6f}, C = {theory.C_min:.6f}")

# %% [markdown]
# Backbones are tracked level by level, 20 dB of noise in the sensors; intervals of 95 % are two standard uncertainties.

# %%
tracked = {}
for ratio in (0.5, 0.65, 0.8):
    noisy = vines.Scene(
        plant={"r": ratio},
        chain={"snr": 20.0, "seed": 1},
        backbone={"C_from": 0.6, "C_to": 0.25, "points": 8, "precision": 0.02},
    )
    tracked[ratio] = vines.backbone(noisy).points, vines.theory(noisy).backbone

# %% [markdown]
# The way to the lock: the controller sees the response of the plant, sample by sample.

# %%
plant, lock = vines.Plant(scene), vines.PhaseLock(scene)
output, history = lock.sample(plant.v), []
for _ in range(12_000):
    plant.advance(lock.sample_time, amplitude=output.amplitude, omega=output.omega)
    output = lock.sample(plant.v)
    history.append((output.omega, output.response_amplitude))
omega, amplitude = np.array(history).T
sigma = (omega / scene.dimensionless["omega0"] - 1) / scene.dimensionless["epsilon"]

# %%
figure, ((manifold, lock_time), (backbone, decay)) = plt.subplots(2, 2, figsize=(7.9, 7))
B = np.linspace(0, 1.3, 200)
manifold.plot(B, np.hypot(R * B, 1 - np.pi * B / 2), color="C5")
manifold.plot(found.decay["B"], found.decay["C"], "o", mfc="none", color="C1")
manifold.set(title="Figure 2", xlabel="speed of the particle B", ylabel="amplitude C", ylim=(0, 1))
lock_time.plot(np.arange(len(sigma)) / 100, sigma)
lock_time.axhline(found.exact.sigma, color="C5", lw=0.75)
lock_time.set(title="Figure 4", xlabel="time, periods", ylabel="detuning $\\sigma$", ylim=(-3, 1))
for n, (ratio, (points, curve)) in enumerate(tracked.items()):
    intervals = {"xerr": 2 * points["u_sigma"], "yerr": 2 * points["u_C"]}
    backbone.errorbar(points["sigma"], points["C"], **intervals, fmt="o", ms=3, color=f"C{n}", label=f"r = {ratio}")
    backbone.plot(curve["sigma"], curve["C"], color=f"C{n}", lw=1)
backbone.set(title="Figure 3", xlabel="detuning $\\sigma$", ylabel="amplitude C", xlim=(-2, -0.5))
backbone.legend()
found.plot(decay)
decay.set(title="Figure 5", xlim=(-2, 0), ylim=(0, 0.6))
decay.legend()
figure.savefig("figures.svg", metadata={"Date": None})
