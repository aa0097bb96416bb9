"""What a master's tape says of the lock."""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from identification import harmonic
from scene import Bench, Tape


@dataclass(frozen=True)
class Lock:
    """Detuning, amplitude over b, and impacts per period."""

    sigma: float
    amplitude: float
    impacts_per_period: float


def measure(bench: Bench, tape: Tape) -> Lock:
    plant = bench.values("plant")
    omega0 = sqrt(plant["k"] / plant["M"])
    epsilon = plant["m"] / plant["M"]
    assert len(tape.v) == bench.hold, "the master has recorded the whole hold"
    response = harmonic(np.array(tape.v), bench.step, float(np.mean(tape.omega)))
    periods = (bench.hold - 1) * bench.step * response.omega / (2 * pi)
    return Lock(
        sigma=(response.omega / omega0 - 1) / epsilon,
        amplitude=response.amplitude / plant["b"],
        # Counted between two samples: off by up to one impact.
        impacts_per_period=(tape.impacts[-1] - tape.impacts[0]) / periods,
    )
