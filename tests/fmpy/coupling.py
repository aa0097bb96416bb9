"""The pair as a plain master couples it: sample by sample, both are read, both are fed, both are stepped."""

from dataclasses import dataclass
from math import pi

import numpy as np

from component import Component
from identification import Harmonic, harmonic

SAMPLE_TIME = 2 * pi / 100
PERIOD = 2 * pi
HOLD_PERIODS = 20

ROW = np.dtype([(name, float) for name in ("time", "v", "base", "omega", "particle")] + [("impacts", int)])


@dataclass(frozen=True)
class Scene:
    """The dimensionless rig, M = k = b = 1, with one excitation and one start; by default the default scene."""

    epsilon: float = 0.0084
    r: float = 0.65
    excitation: float = 1.1
    particle_velocity: float = 0.9
    damping: float = 1.43

    @property
    def amplitude(self) -> float:
        return self.epsilon * self.excitation

    def plant(self) -> dict[str, float]:
        coefficient = self.epsilon * self.damping
        masses = {"M": 1, "k": 1, "b": 1, "m": self.epsilon, "c": coefficient}
        return masses | {"r": self.r, "der(q2)": self.particle_velocity}

    def controller(self) -> dict[str, float]:
        return {
            "sample_time": SAMPLE_TIME,
            "omega_start": 1,
            "omega_min": 0.9,
            "omega_max": 1.1,
            "amplitude": self.amplitude,
            "bandwidth": 0.1,
            "response_gain": 0.5,
            "amplitude_max": 4 * self.amplitude,
            "acquire_timeout": 2000 * PERIOD,
            "signal_timeout": 20 * PERIOD,
        }

    def sigma(self, omega: float) -> float:
        return (omega - 1) / self.epsilon


@dataclass(frozen=True)
class Record:
    """The hold of a settled lock."""

    scene: Scene
    step: float
    rows: np.ndarray

    def fundamental(self, name: str) -> Harmonic:
        return harmonic(self.rows[name], self.step, self.rows["omega"].mean())

    def impacts_per_period(self) -> float:
        """Counted between two samples: off by up to one impact."""
        first, last = self.rows[0], self.rows[-1]
        periods = (last["time"] - first["time"]) * self.fundamental("v").omega / (2 * pi)
        return (last["impacts"] - first["impacts"]) / periods


class Pair:
    """Plant and controller on one clock."""

    def __init__(
        self, plant: Component, controller: Component, step: float, *, reference: bool = True, sampled: bool = False
    ):
        """`sampled`: the base follows samples of the drive signal instead of its own oscillator."""
        self.plant, self.controller, self.step = plant, controller, step
        self.sensors = plant.group("v", "base", "der(q2)")
        self.impacts = plant.group("impacts")
        self.sampled = sampled
        self.drive = plant.group("e") if sampled else plant.group("omega", "E")
        self.command = controller.group("omega", "E", "drive")
        self.settled = controller.group("settled")
        self.inputs = controller.group("response", "reference") if reference else controller.group("response")
        controller.set({"active": True})
        self.rows: list[tuple] = []

    def sample(self) -> bool:
        """One communication point, then one step; returns whether the controller calls its lock settled."""
        v, base, particle = self.sensors.get()
        omega, amplitude, drive = self.command.get()
        (settled,) = self.settled.get()
        (impacts,) = self.impacts.get()
        time = len(self.rows) * self.step
        self.rows.append((time, v, base, omega, particle, impacts))
        self.inputs.set(*(v, base)[: self.inputs.count])
        self.drive.set(*([drive] if self.sampled else [omega, amplitude]))
        self.plant.step(self.step)
        self.controller.step(self.step)
        return bool(settled)

    def periods(self, count: float) -> int:
        return round(count * PERIOD / self.step)


def experiment(pair: Pair, scene: Scene, *, lock_periods: int = 2000) -> Record:
    """Drives the pair until its lock is settled, and holds it."""
    for _ in range(pair.periods(lock_periods)):
        if pair.sample():
            break
    else:
        raise AssertionError(f"no settled lock within {lock_periods} periods: {pair.controller.outputs()}")
    settled = len(pair.rows)
    for _ in range(pair.periods(HOLD_PERIODS)):
        pair.sample()
    return Record(scene, pair.step, np.array(pair.rows[settled:], dtype=ROW))
