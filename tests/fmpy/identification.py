"""What a recorded response says: amplitude and frequency, the regime of the impacts, the backbone along a decay."""

from dataclasses import dataclass
from math import atan2, hypot, pi

import numpy as np

ROUNDS = 5
WINDOW_PERIODS = 1.5
POINTS_PER_PERIOD = 8


@dataclass(frozen=True)
class Harmonic:
    """A fundamental `amplitude sin(phase)` at the middle of a window, and its angular frequency there."""

    amplitude: float
    phase: float
    omega: float


def harmonic(values: np.ndarray, step: float, omega: float) -> Harmonic:
    """Least squares of a fundamental with linear drift, a third harmonic and an offset; omega is refined from a guess.

    A guess that is off by d makes the fitted phase drift by d: the drift corrects it, and the fit is repeated.
    """
    time = (np.arange(len(values)) - (len(values) - 1) / 2) * step
    for _ in range(ROUNDS):
        sine, cosine = np.sin(omega * time), np.cos(omega * time)
        third = [np.sin(3 * omega * time), np.cos(3 * omega * time)]
        basis = np.column_stack([sine, cosine, time * sine, time * cosine, *third, np.ones_like(time)])
        (a, b, a_drift, b_drift, *_), *_ = np.linalg.lstsq(basis, values)
        omega += (a * b_drift - b * a_drift) / (a**2 + b**2)
    return Harmonic(hypot(a, b), atan2(b, a), omega)


@dataclass(frozen=True)
class Regime:
    """How the particle hits: per period, on which walls, how evenly (standard deviation of the intervals over mean)."""

    per_period: float
    alternating: bool
    spread: float

    @property
    def symmetric(self) -> bool:
        return abs(self.per_period - 2) < 0.02 and self.alternating and self.spread < 0.01


def impacts(rows: np.ndarray) -> np.ndarray:
    """The rows that first tell of an impact; two between two samples would show as one, and as a broken alternation."""
    return rows[1:][np.diff(rows["impacts"]) > 0]


def regime(rows: np.ndarray, omega: float) -> Regime:
    hits = impacts(rows)
    duration = rows["time"][-1] - rows["time"][0]
    count = rows["impacts"][-1] - rows["impacts"][0]
    if len(hits) < 3:
        return Regime(count * 2 * pi / omega / duration, False, np.inf)
    intervals = np.diff(hits["impact_time"])
    per_period = (count - 1) * 2 * pi / omega / intervals.sum()
    alternating = bool(np.all(np.diff(np.sign(hits["impact_velocity"])) != 0))
    return Regime(per_period, alternating, float(intervals.std() / intervals.mean()))


def end_of_synchrony(rows: np.ndarray) -> float:
    """Time of the last impact before two follow on one wall, or at an interval a fifth off the one before."""
    hits = impacts(rows)
    intervals = np.diff(hits["impact_time"])
    same_wall = np.diff(np.sign(hits["impact_velocity"])) == 0
    off = np.abs(intervals[1:] / intervals[:-1] - 1) > 0.2
    lost = np.flatnonzero(same_wall[1:] | off)
    return float(hits["impact_time"][lost[0] + 1 if len(lost) else -1])


def decay(rows: np.ndarray, step: float, omega: float) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude and angular frequency of v along a free decay, as long as the impacts keep in step."""
    rows = rows[rows["time"] <= end_of_synchrony(rows)]
    window = round(WINDOW_PERIODS * 2 * pi / omega / step) + 1
    hop = round(2 * pi / omega / step / POINTS_PER_PERIOD)
    points = []
    for first in range(0, len(rows) - window + 1, hop):
        fit = harmonic(rows["v"][first : first + window], step, omega)
        omega = fit.omega
        points.append((fit.amplitude, fit.omega))
    amplitude, frequency = np.array(points).T
    return amplitude, frequency
