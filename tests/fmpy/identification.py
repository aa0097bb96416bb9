"""The fundamental of a recorded response."""

from dataclasses import dataclass
from math import atan2, hypot

import numpy as np

ROUNDS = 5


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
