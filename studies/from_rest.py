"""Does one script over two PI loops bring random rigs from rest to the drive asked for?

python studies/from_rest.py [RIGS] [SEED] [PERIODS]    writes validation/from_rest.csv

Phase by frequency, response by drive. The script raises the setpoint of the response until the drive shows impacts
(it departs from what the linear response needs), then moves the setpoint along the backbone until the drive that
holds it is the one asked for, and hands over to that constant drive. It knows the sensor v, the natural frequency
and the damping rate; epsilon enters in the slowest rate and the largest drive, which a user would set. Lengths in
units of b, times in units of 1/omega0. No noise.
"""

import csv
import sys
from pathlib import Path

import numpy as np

import vines

SAMPLES = 100  # a period
STEP = 2 * np.pi / SAMPLES
PERIOD = 2 * np.pi
GAIN = 0.5  # g = omega0^2/(2 omega): growth of the response per drive
PHASE_LOOP = 0.08  # bandwidths of the loops
RESPONSE_LOOP = 0.04
WINDOW = 12  # periods of a judgement
DEPARTURE = 0.2  # of the drive, beyond the linear response: impacts
QUIET = 0.02  # residual of the response about a straight line: a steady motion
NEAR = 0.02  # of the drive asked for: hand over
FASTEST = 0.01  # change of the setpoint in a period, relative
NAMES = ("raise the response", "along the backbone", "constant drive")


def scene(epsilon: float, damping: float, r: float, g: float) -> vines.Scene:
    """Return the scene of a rig."""
    plant = f"[plant]\nepsilon = {epsilon!r}\nlambda = {damping!r}\nr = {r!r}\n[excitation]\nG = {g!r}\n"
    return vines.Scene(text=plant + "[controller]\nomega_min = 0.8\nomega_max = 1.2\n")


def draw(rng: np.random.Generator, count: int) -> tuple[np.ndarray, list[list[vines.Orbit]]]:
    """Draw rigs that have a stable symmetric orbit at phase resonance: epsilon, lambda, r, G, and the orbits."""
    rows: list[tuple[float, ...]] = []
    orbits = []
    while len(rows) < count:
        epsilon, damping = float(10 ** rng.uniform(-3, np.log10(0.05))), float(10 ** rng.uniform(-1, np.log10(3)))
        r = float(rng.uniform(0.2, 0.97))
        loss = (1 - r) / (1 + r)
        least = (np.pi / 2) / (loss**2 + np.pi**2 / 4)
        speed = least + (2 * np.pi / (np.pi**2 - 4) - least) * rng.uniform()
        level = np.sqrt((loss * speed) ** 2 + (1 - np.pi * speed / 2) ** 2)
        g = float(damping * level + 4 / np.pi * loss * speed**2 / level)
        stable = [orbit for orbit in vines.orbits(scene(epsilon, damping, r, g)) if orbit.stable]
        if stable:
            rows.append((epsilon, damping, r, g))
            orbits.append(stable)
    return np.array(rows), orbits


def run(rigs: np.ndarray, periods: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return detuning and response at the end, the stage reached, and the period of the hand-over (-1: none)."""
    epsilon, damping, r, g = rigs.T
    count = len(rigs)
    plant = {
        "M": np.ones(count),
        "k": np.ones(count),
        "c": epsilon * damping,
        "m": epsilon,
        "b": np.ones(count),
        "r": r,
    }
    batch = vines.Batch(plant)
    linear = epsilon * damping  # drive per response of the linear motion at resonance, as a loop check measures it
    asked = epsilon * g
    rate = np.minimum(0.25 * PERIOD * np.maximum(linear, 0.3 * epsilon), FASTEST)
    phase, omega, tuned = np.zeros(count), np.ones(count), np.ones(count)
    drive, held, setpoint = np.zeros(count), np.zeros(count), np.zeros(count)
    stage, departed, returned, near = (np.zeros(count, int) for _ in range(4))
    handed_over = np.full(count, -1)
    readings = np.zeros((count, SAMPLES), complex)
    levels, drives, detunings, errors = (np.zeros((count, WINDOW)) for _ in range(4))
    time = np.arange(WINDOW) - (WINDOW - 1) / 2
    for period in range(periods):
        work = np.zeros(count)
        for sample in range(SAMPLES):
            batch.advance(STEP, amplitude=drive, omega=omega, events=False)
            phase += omega * STEP
            states = batch.states
            readings[:, sample] = (states[:, 0] + epsilon * states[:, 2]) * np.exp(-1j * phase)
            phasor = -2 * readings.mean(axis=1)
            level = np.abs(phasor)
            error = np.where(level > 1e-6, np.angle(phasor), 0.0)
            tuned = np.clip(tuned + PHASE_LOOP**2 / 4 * error * STEP, 0.8, 1.2)
            omega = np.clip(tuned + PHASE_LOOP * error, 0.8, 1.2)
            closed, short = stage < 2, setpoint - level
            held = np.where(closed, np.clip(held + RESPONSE_LOOP**2 / 4 / GAIN * short * STEP, 0, 40 * epsilon), asked)
            drive = np.where(closed, np.clip(held + RESPONSE_LOOP / GAIN * short, 0, 40 * epsilon), asked)
            work += drive * np.cos(error) / SAMPLES
        for window, value in ((levels, level), (drives, work), (detunings, omega - 1), (errors, error)):
            window[:, :-1] = window[:, 1:]
            window[:, -1] = value
        mean, duration = levels.mean(axis=1), (WINDOW - 1) * PERIOD
        growth = (levels[:, -1] - levels[:, 0]) / duration
        turning = detunings.mean(axis=1) + (errors[:, -1] - errors[:, 0]) / duration
        needed = drives.mean(axis=1) - growth / GAIN
        slope = (levels * time).sum(axis=1) / (time**2).sum()
        residual = np.std(levels - mean[:, None] - slope[:, None] * time, axis=1)
        # What impacts take from the drive, and how they turn it.
        impacts = np.hypot(needed - linear * mean, mean * turning / GAIN)
        seen = impacts > DEPARTURE * np.maximum(linear * mean, drives.mean(axis=1))
        departed, returned = np.where(seen, departed + 1, 0), np.where(seen, 0, returned + 1)
        found = (stage == 0) & (departed > WINDOW) & (period > 2 * WINDOW)
        lost = (stage == 1) & (returned > WINDOW)
        setpoint = np.where(stage == 0, setpoint + np.minimum(4 * GAIN * rate, 0.02), np.where(lost, level, setpoint))
        stage = np.where(found, 1, np.where(lost, 0, stage))
        departed = np.where(lost, 0, departed)
        along = stage == 1
        steady = (residual < QUIET * mean) & (np.abs(errors).max(axis=1) < 0.1)
        direction = np.where(steady, np.clip(3 * (needed / asked - 1), -1, 1), 1.0)
        setpoint = np.where(along, setpoint * np.exp(-rate * direction), setpoint)
        near = np.where(along & steady & (np.abs(needed / asked - 1) < NEAR), near + 1, 0)
        arrives = along & (near > WINDOW)
        stage = np.where(arrives, 2, stage)
        handed_over = np.where(arrives, period, handed_over)
    return detunings.mean(axis=1) / epsilon, levels.mean(axis=1), stage, handed_over


def main() -> None:
    """Draw, run, compare with the exact orbits, write."""
    numbers = [int(argument) for argument in sys.argv[1:]] + [40, 1, 4000][len(sys.argv) - 1 :]
    count, seed, periods = numbers
    rigs, orbits = draw(np.random.default_rng(seed), count)
    sigma, level, stage, handed_over = run(rigs, periods)
    path = Path(__file__).parent.parent / "validation" / "from_rest.csv"
    path.parent.mkdir(exist_ok=True)
    distances = [
        min(max(abs(one.sigma - s), abs(one.C - c)) for one in stable)
        for stable, s, c in zip(orbits, sigma, level, strict=True)
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(
            "# Random rigs from rest by studies/from_rest.py: end of each run, distance from the nearest stable orbit\n"
        )
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["epsilon", "lambda", "r", "G", "stage", "handed over, periods", "sigma", "C", "distance"])
        for rig, where, when, *found in zip(rigs, stage, handed_over, sigma, level, distances, strict=True):
            numbers = [f"{value:.6g}" for value in (*rig, *found)]
            writer.writerow([*numbers[:4], NAMES[where], when if when >= 0 else "", *numbers[4:]])
    reached = np.array(distances) < 0.02
    after = np.median(handed_over[handed_over >= 0]) if (handed_over >= 0).any() else np.nan
    print(f"{reached.sum()} of {count} within 0.02 of a stable orbit; hand-over after {after:.0f} periods (median)")


if __name__ == "__main__":
    main()
