"""A controller of one's own, coupled to the plant without a network and judged by the exact orbit.

python examples/controller.py [FOLDER]    writes controller.svg
"""

import cmath
import math
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import vines

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
folder.mkdir(parents=True, exist_ok=True)
scene = vines.Scene()
numbers, start = scene.dimensionless, scene.drive(sigma=0.0)
step = 2 * math.pi / numbers["omega0"] / 100
bandwidth, kp, ki = 0.1 * numbers["omega0"], 1.742, 1.353  # rad/s; gains that `vines check` prints

plant = vines.Plant(dq2=0.5)
theta = integral = 0.0
z_response = z_base = 0j
omega = start["omega"]
history = []
for _ in range(30_000):
    # The controller: two adaptive filters x = Re(z exp(i theta)), and a loop that holds their phase at -90 degrees.
    turn = cmath.exp(1j * theta)
    z_response += 2 * bandwidth * step * (plant.v - (z_response * turn).real) / turn
    z_base += 2 * bandwidth * step * (plant.base - (z_base * turn).real) / turn
    error = cmath.phase(z_response / z_base * 1j) if abs(z_base) > 0.5 * start["amplitude"] else 0.0
    integral += ki * error * step
    omega = start["omega"] + kp * error + integral
    theta += omega * step
    # The rig, as it answers to this drive until the next sample.
    plant.advance(step, amplitude=start["amplitude"], omega=omega)
    history.append((omega, abs(z_response), error))

omegas, responses, errors = np.array(history).T
sigma = (omegas / numbers["omega0"] - 1) / numbers["epsilon"]
amplitude = responses / numbers["b"]
periods = np.arange(len(sigma)) / 100
exact = next(orbit for orbit in vines.orbits(scene) if orbit.stable)
last = slice(-2000, None)
print(f"sigma = {sigma[last].mean():.4f}, exact orbit {exact.sigma:.4f}")
print(f"C     = {amplitude[last].mean():.4f}, exact orbit {exact.C:.4f}")
print(f"phase error {math.degrees(np.abs(errors[last]).max()):.3f} degrees at most in the last 20 periods")

figure, (upper, lower) = plt.subplots(2, sharex=True, figsize=(6, 4.5), layout="constrained")
upper.plot(periods, sigma, lw=1, label="controller")
upper.axhline(exact.sigma, color="k", lw=1, label="exact orbit")
upper.set(ylabel="detuning $\\sigma$", ylim=(-3, 3))
upper.legend()
lower.plot(periods, amplitude, lw=1)
lower.axhline(exact.C, color="k", lw=1)
lower.set(xlabel="time, periods", ylabel="amplitude C")
figure.savefig(folder / "controller.svg")
