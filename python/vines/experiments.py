"""Experiments on the simulated rig, exact orbits and first-order theory."""

import json
import warnings
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _native
from .datasets import dataset
from .results import Result, axes
from .scenes import Scene, checked

if TYPE_CHECKING:
    import xarray

#: A table: one array per column; a missing number is NaN.
Table = dict[str, NDArray[Any]]


def _table(rows: list[dict[str, Any]]) -> Table:
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: _column([row.get(name) for row in rows]) for name in names}


def _column(values: list[Any]) -> NDArray[Any]:
    kinds = {type(value) for value in values} - {type(None)}
    if kinds <= {float, int}:
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)
    return np.array(["" if value is None else value for value in values] if str in kinds else values)


SI = {"t_s": "s", "f_Hz": "Hz", "u_f_Hz": "Hz", "A_m": "m", "u_A_m": "m", "E_m": "m", "u_E_m": "m"}
SI |= {"F_N": "N", "u_F_N": "N", "command_V": "V"}
"""Units of the columns that are not dimensionless."""


def _dataset(table: Table, dimension: str, units: dict[str, str], **attributes: Any) -> "xarray.Dataset":
    columns = {
        name: (dimension, values) for name, values in table.items() if values.ndim == 1 and values.dtype != object
    }
    return dataset(columns, {name: units.get(name, "1") for name in columns}, **attributes)


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Result):
    """What an experiment found, in hertz and metres, and dimensionless with the parameters of the scene.

    Attributes
    ----------
    lock : dict
        The locked point: f_Hz, A_m (at the sensor), E_m, G, sigma, C, B, phase_target_deg, phase_error_deg, their
        standard uncertainties u_*, motion, regime_by_impacts and others; of a force test F_N and u_F_N instead of E_m
        and u_E_m, and behind a shaker its command, command_V.
    exact : Orbit or None
        The exact phase-resonant orbit with the measured C, if there is one.
    decay : dict of ndarray
        Points along the free decay: t_s, f_Hz, A_m, tau, C, B, sigma, standard uncertainties, and at the same C
        sigma_theory and sigma_exact of steady motions, and sigma_slow_flow of the decay that theory predicts.
    decay_end : str
        What ended the points.
    rms_sigma_error, rms_sigma_exact, rms_sigma_slow_flow : float or None
        RMS of the decay's sigma minus theory, minus the exact backbone, and minus the decay of the slow flow, over
        C > 0.2.
    theory : Theory
        First-order theory of the scene.
    """

    lock: dict[str, Any]
    exact: "Orbit | None"
    decay: Table
    decay_end: str
    rms_sigma_error: float | None
    rms_sigma_exact: float | None
    rms_sigma_slow_flow: float | None
    theory: "Theory"

    def plot(self, ax: Any = None) -> Any:
        """Draw C over sigma: theory (dashed: unstable), exact orbits, decay and lock. Return the axes of matplotlib."""
        ax = self.theory.plot(ax)
        if self.decay:
            ax.plot(self.decay["sigma_exact"], self.decay["C"], lw=1, label="exact orbits")
            ax.plot(self.decay["sigma"], self.decay["C"], "o", ms=3, label="decay")
        ax.plot(self.lock["sigma"], self.lock["C"], "s", label="lock")
        ax.legend()
        return ax

    def to_xarray(self) -> "xarray.Dataset":
        """Return the decay as a dataset over the dimension `point`; the locked point is in its attributes."""
        lock = {f"lock_{name}": value for name, value in self.lock.items() if value is not None}
        return _dataset(self.decay, "point", SI, **lock)


def identify(scene: Scene | None = None, *, results: Literal["all", "lock"] = "all") -> Identification:
    """Lock the plant at phase resonance, let it decay, and identify its backbone, as `vines identify` does.

    Parameters
    ----------
    scene : Scene, optional
        Default: the default scene.
    results : {"all", "lock"}
        "lock": the locked point only; the decay is neither simulated nor identified, and has no points.

    Returns
    -------
    Identification
        A warning says so if its lock is at another drive than the requested one, by more than 1 % and three standard
        uncertainties.

    Raises
    ------
    ValueError
        A setting that the controller cannot work with; other results.
    RuntimeError
        No lock in the time allowed, or another regime than the symmetric 1:1 one.

    Examples
    --------
    >>> found = identify()
    >>> round(found.lock["sigma"], 4), found.lock["regime_by_impacts"]
    (-1.1396, 'symmetric 1:1')
    """
    if results not in ("all", "lock"):
        raise ValueError(f"results = {results!r}: 'all' and 'lock' are allowed")
    found = json.loads(_native.identify(checked(scene)._native, results == "all"))
    lock = found["lock"]
    if not lock["at_requested_drive"]:
        name, unit = ("F", "N") if "F_N" in lock else ("E", "m")
        drive, asked = lock[f"{name}_{unit}"], lock[f"{name}_requested_{unit}"]
        message = f"the lock is at another drive: {name} = {drive:.5e} {unit}, and {asked:.5e} {unit} was asked for"
        warnings.warn(message, stacklevel=2)
    return Identification(
        theory=theory(scene),
        lock=lock,
        exact=Orbit._of(found["exact"]) if found["exact"] else None,
        decay=_table(found["decay"]),
        **{key: found[key] for key in ("decay_end", "rms_sigma_error", "rms_sigma_exact", "rms_sigma_slow_flow")},
    )


@dataclass(frozen=True, eq=False, repr=False)
class Backbone(Result):
    """A tracked backbone, in hertz and metres, and dimensionless with the parameters of the scene.

    Attributes
    ----------
    points : dict of ndarray
        f_Hz, A_m, E_m, C, sigma, G, their standard uncertainties u_*, phase_target_deg, level, periods, settled,
        reached, motion, regime_by_impacts and others; of a force test F_N instead of E_m, and behind a shaker its
        command, command_V.
    periods : float
        All periods, from the start to the last point.
    theory : Theory
        First-order theory of the scene.
    """

    points: Table
    periods: float
    theory: "Theory"

    def plot(self, ax: Any = None) -> Any:
        """Draw C over sigma: theory (dashed where unstable), and the settled points. Return the axes of matplotlib."""
        ax = self.theory.plot(ax)
        settled = self.points["settled"].astype(bool)
        ax.plot(self.points["sigma"][settled], self.points["C"][settled], "o", label="tracked")
        ax.legend()
        return ax

    def to_xarray(self) -> "xarray.Dataset":
        """Return the points as a dataset over the dimension `point`."""
        units = SI | dict.fromkeys(("phase_target_deg", "phase_error_deg", "u_phase_deg"), "degree")
        return _dataset(self.points, "point", units, periods=self.periods)


def backbone(scene: Scene | None = None) -> Backbone:
    """Track the backbone level by level with the response controlled, as `vines backbone` does.

    Parameters
    ----------
    scene : Scene, optional
        Its section backbone has the levels. Default: the default scene.

    Returns
    -------
    Backbone

    Raises
    ------
    ValueError
        A setting that the controller cannot work with.
    RuntimeError
        No lock in the time allowed, or a controller that switches the drive off.

    Examples
    --------
    >>> found = backbone(Scene(backbone={"C_from": 0.6, "C_to": 0.4, "points": 3}))
    >>> found.points["C"].round(2)
    array([0.6, 0.5, 0.4])
    """
    found = json.loads(_native.backbone(checked(scene)._native))
    points = [
        {**point, **{f"{k}_difference": v for k, v in (point.pop("exact") or {}).items()}} for point in found["points"]
    ]
    return Backbone(points=_table(points), periods=found["periods"], theory=theory(scene))


@dataclass(frozen=True, eq=False, repr=False)
class Orbit(Result):
    """An exact symmetric 1:1 orbit; dimensionless.

    Attributes
    ----------
    G, sigma, C, B : float
        Base amplitude over b epsilon, detuning, amplitude of the first harmonic of the response over b,
        speed of the particle over b omega0.
    gamma : float
        Phase of the response relative to the reference, rad.
    multipliers : tuple of float
        Moduli of the multipliers over half a period, ascending.
    stable : bool
        All multipliers are inside the unit circle.
    neutral : bool
        The largest are on it within 1e-7: disturbances neither grow nor decay.
    """

    G: float
    sigma: float
    C: float
    B: float
    gamma: float
    multipliers: tuple[float, float, float, float]
    stable: bool
    neutral: bool

    def to_xarray(self) -> "xarray.Dataset":
        """Return a dataset whose only dimension is `multiplier`, with units as attributes."""
        units = {"G": "1", "sigma": "1", "C": "1", "B": "1", "gamma": "rad", "multipliers": "1"}
        values = {name: ((), value) for name, value in asdict(self).items()}
        return dataset(values | {"multipliers": ("multiplier", list(self.multipliers))}, units)

    @classmethod
    def _of(cls, found: dict[str, Any]) -> "Orbit":
        names = ("G", "sigma", "C", "B", "gamma", "stable", "neutral")
        return cls(**{name: found[name] for name in names}, multipliers=tuple(found["multipliers"]))


def orbits(scene: Scene | None = None, sigma: float | None = None) -> list[Orbit]:
    """Return the exact symmetric 1:1 orbits of a scene.

    Parameters
    ----------
    scene : Scene, optional
        Default: the default scene.
    sigma : float, optional
        Detuning. Without it: the orbits at phase resonance.

    Returns
    -------
    list of Orbit
        By rising C; none where no such orbit exists.

    Raises
    ------
    ValueError
        A sigma that is not finite.

    Examples
    --------
    >>> [(round(orbit.sigma, 6), orbit.stable) for orbit in orbits()][0]
    (-1.139376, True)
    """
    found = json.loads(_native.orbits(checked(scene)._native, sigma))
    return [Orbit._of(one) for one in found]


@dataclass(frozen=True, eq=False, repr=False)
class Theory(Result):
    """First-order theory; dimensionless.

    Attributes
    ----------
    backbone : dict of ndarray
        C, B, sigma, G, branch, impacts_stable and slow_flow_stable along the backbone, from the fold to
        symmetry breaking.
    solutions : dict of ndarray
        The same at phase resonance and the scene's G.
    B_min, C_min : float
        The fold of the slow invariant manifold.
    """

    backbone: Table
    solutions: Table
    B_min: float
    C_min: float

    def plot(self, ax: Any = None) -> Any:
        """Draw C over sigma, dashed where impacts or slow flow are unstable. Return the axes of matplotlib."""
        ax = axes(ax)
        stable = self.backbone["impacts_stable"] & self.backbone["slow_flow_stable"]
        for style, where, label in (("-", stable, "theory"), ("--", ~stable, "theory, unstable")):
            ax.plot(np.where(where, self.backbone["sigma"], np.nan), self.backbone["C"], f"k{style}", lw=1, label=label)
        ax.set(xlabel="detuning sigma", ylabel="amplitude C")
        return ax

    def to_xarray(self) -> "xarray.Dataset":
        """Return the backbone as a dataset over the dimension `point`."""
        return _dataset(self.backbone, "point", {}, B_min=self.B_min, C_min=self.C_min)


def theory(scene: Scene | None = None, points: int = 200) -> Theory:
    """Return the backbone of first-order theory, and its solutions at the scene's G.

    Parameters
    ----------
    scene : Scene, optional
        Default: the default scene.
    points : int
        Number of points along the backbone, 2 to 10000.

    Returns
    -------
    Theory

    Raises
    ------
    ValueError
        A number of points that is not allowed.

    Examples
    --------
    >>> theory().solutions["sigma"].round(4)[-1]
    np.float64(-1.1817)
    """
    scene = checked(scene)
    if "structure" in scene.settings:
        warnings.warn("theory is of the driven mode alone, without the other modes of the structure", stacklevel=2)
    found = json.loads(_native.theory(scene._native, points))
    return Theory(_table(found["backbone"]), _table(found["solutions"]), found["B_min"], found["C_min"])
