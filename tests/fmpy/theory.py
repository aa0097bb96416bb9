"""First-order theory of the backbone, by itself: slow invariant manifold and detuning at phase resonance."""

from math import pi

import numpy as np


def dissipation(r: float) -> float:
    """R = (1 - r)/(1 + r)."""
    return (1 - r) / (1 + r)


def fold(r: float) -> tuple[float, float]:
    """Amplitude C and particle speed B where the branches of the manifold meet."""
    square = dissipation(r) ** 2 + pi**2 / 4
    return dissipation(r) / np.sqrt(square), pi / 2 / square


def particle_speed(amplitude: np.ndarray, r: float) -> np.ndarray:
    """B on the right branch, from C^2 = R^2 B^2 + (1 - pi B/2)^2."""
    c_min, b_min = fold(r)
    return b_min + np.sqrt(2 / pi * b_min * (amplitude**2 - c_min**2))


def backbone(amplitude: np.ndarray, r: float) -> np.ndarray:
    """Detuning sigma at phase resonance over the amplitude C of v, right branch."""
    speed = particle_speed(amplitude, r)
    return 2 / pi * speed * (1 - pi * speed / 2) / amplitude**2
