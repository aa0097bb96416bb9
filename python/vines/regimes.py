"""The regime of a response."""

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from . import _native
from .datasets import dataset
from .results import Result
from .scenes import Scene, checked

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False, repr=False)
class Regime(Result):
    """The regime at one detuning, as `vines map` decides it; docs/regimes.md has the rules.

    Attributes
    ----------
    sigma : float
        Detuning.
    regime : str
        no impacts, symmetric 1:1, asymmetric 1:1, n impacts, quasi-periodic, modulated, chaotic or undecided.
    followed : int
        Periods of the base that were simulated.
    transient : float
        Periods before the regime began.
    impacts_per_period, sticks_per_period : float
        Impacts, and how often the particle comes to rest on a wall, per period of the base.
    impacts, periods : int
        Of one repetition; 0 if nothing repeats.
    exponent, exponent_error : float or None
        Largest Lyapunov exponent per period and its standard error.
    synchrony : float
        Share of the impacts that belong to captures into 1:1 resonance.
    recurrence : float or None
        Largest difference between the state and that one repetition before.
    """

    sigma: float
    regime: str
    followed: int
    transient: float
    impacts_per_period: float
    sticks_per_period: float
    impacts: int
    periods: int
    exponent: float | None
    exponent_error: float | None
    synchrony: float
    recurrence: float | None

    def to_xarray(self) -> "xarray.Dataset":
        """Return a dataset without dimensions."""
        values = {name: ((), value) for name, value in asdict(self).items() if value is not None}
        return dataset(values, dict.fromkeys(values, "1"))


def regime(scene: Scene | None = None, sigma: float | None = None, periods: int = 20_000) -> Regime:
    """Drive the plant from the scene's start at a constant frequency until the regime of its response is decided.

    Parameters
    ----------
    scene : Scene, optional
        Default: the default scene.
    sigma : float, optional
        Detuning. Without it: that of the scene's stable phase-resonant orbit, or 0.
    periods : int
        Largest number of periods, 100 to 100000; an undecided motion is followed for sixteen times as
        long, but no more than 100000 periods or four times as long, whichever is more.

    Returns
    -------
    Regime

    Raises
    ------
    ValueError
        A value that is not allowed.

    Examples
    --------
    >>> regime(sigma=-1.1).regime
    'symmetric 1:1'
    """
    found = json.loads(_native.regime(checked(scene)._native, sigma, periods))
    return Regime(sigma=found["sigma"], **found["point"])
