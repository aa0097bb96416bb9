# %% [markdown]
# # A controller of your own
# It is coupled to the plant without a network, sample by sample, and judged by the exact orbit.

# %%
import cmath
import math

import matplotlib.pyplot as plt
import numpy as np

import vines

plt.style.use("vines.figures")
scene = vines.Scene()
numbers, start = scene.dimensionless, scene.drive(sigma=0.0)
step = 2 * math.pi / numbers["omega0"] / 100
bandwidth, kp, ki = 0.1 * numbers["omega0"], 1.742, 1.353  # rad/s; gains that `vines check` prints

# %% [markdown]
# Two adaptive filters x = Re(z exp(i theta)), and a loop that holds their phase at -90 degrees.

# %%
plant = vines.Plant(dq2=0.5)
theta = integral = 0.0
z_response = z_base = 0j
omega = start["omega"]
history = []
for _ in range(30_000):
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

# %%
omegas, responses, errors = np.array(history).T
sigma = (omegas / numbers["omega0"] - 1) / numbers["epsilon"]
amplitude = responses / numbers["b"]
periods = np.arange(len(sigma)) / 100
exact = next(orbit for orbit in vines.orbits(scene) if orbit.stable)
last = slice(-2000, None)
print(f"sigma = {sigma[last].mean():.4f}, exact orbit {exact.sigma:.4f}")
print(f"C     = {amplitude[last].mean():.4f}, exact orbit {exact.C:.4f}")
print(f"phase error {math.degrees(np.abs(errors[last]).max()):.3f} degrees at most in the last 20 periods")

# %%
figure, (upper, lower) = plt.subplots(2, sharex=True, figsize=(7.9, 5))
upper.plot(periods, sigma, color="C1", label="controller")
upper.axhline(exact.sigma, lw=1, label="exact orbit")
upper.set(ylabel="detuning $\\sigma$", ylim=(-3, 3), title="The way to the lock")
upper.legend()
lower.plot(periods, amplitude, color="C1")
lower.axhline(exact.C, lw=1)
lower.set(xlabel="time, periods", ylabel="amplitude C")
figure.savefig("controller.svg", metadata={"Date": None})
