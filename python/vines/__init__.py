"""A virtual test bench for a linear oscillator with a vibro-impact nonlinear energy sink.

Quantities have the units and names of the scenes: SI units for the plant, and dimensionless numbers for theory, orbits
and regimes (C over b, B over b omega0, sigma = (omega/omega0 - 1)/epsilon, G = E/(b epsilon)). A value that is not
allowed is a `ValueError` with the value, its unit and what is allowed; an experiment that fails, such as one without a
lock, is a `RuntimeError`. Long calculations release the interpreter lock; after Ctrl-C,
`KeyboardInterrupt` follows within a second. Nothing is printed.
"""

from importlib.resources import files as _files
from pathlib import Path as _Path

from ._native import version as __version__
from .experiments import Backbone, Identification, Orbit, Theory, backbone, identify, orbits, theory
from .fits import Fit, fit, fit_recordings
from .phaselock import Output, PhaseLock
from .plants import KINDS, Batch, Events, Plant, Trajectory
from .recordings import LinearDecay, Recording, linear_decay, read_recording
from .regimes import Regime, regime
from .scenes import Scene
from .structures import StructurePlant, scene_from_uff, structure_from_uff
from .sweeps import REGIMES, sweep

__all__ = [
    "KINDS",
    "REGIMES",
    "Backbone",
    "Batch",
    "Events",
    "Fit",
    "Identification",
    "LinearDecay",
    "Orbit",
    "Output",
    "PhaseLock",
    "Plant",
    "Recording",
    "Regime",
    "Scene",
    "StructurePlant",
    "Theory",
    "Trajectory",
    "__version__",
    "backbone",
    "fit",
    "fit_recordings",
    "fmu",
    "identify",
    "linear_decay",
    "orbits",
    "read_recording",
    "regime",
    "scene_from_uff",
    "structure_from_uff",
    "sweep",
    "theory",
]

_FMUS = ("LoViNes", "PhaseLock")


def fmu(name: str) -> _Path:
    """Return the path of an FMU in this package.

    Parameters
    ----------
    name : str
        `"LoViNes"`, the plant, or `"PhaseLock"`, the controller.

    Returns
    -------
    pathlib.Path
        The FMU, for FMPy and others.

    Raises
    ------
    ValueError
        There is no FMU of that name.

    Examples
    --------
    >>> fmu("LoViNes").name
    'LoViNes.fmu'
    """
    if name not in _FMUS:
        raise ValueError(f"there is no FMU {name!r}; known are {' and '.join(_FMUS)}")
    return _Path(str(_files(__name__) / "fmu" / f"{name}.fmu"))
