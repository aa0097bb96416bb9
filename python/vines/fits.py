"""Parameters of a rig from measured points of its backbone."""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from .experiments import Table, _table
from .numbers import real, reals
from .recordings import LinearDecay, Recording, linear_decay
from .results import Result, axes
from .scenes import Scene, checked

_LINEAR = ("f0_Hz", "u_f0_Hz", "zeta", "u_zeta", "correlation", "particle")
_MOTIONS = {
    "motion": ("nonlinear, symmetric", "nonlinear, symmetry unresolved"),
    "regime": ("symmetric 1:1", "steady, symmetry unresolved"),
}


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Result):
    """A rig fitted to points of its backbone.

    Attributes
    ----------
    parameters : dict of ndarray
        symbol, unit, value, uncertainty and expected: f0, zeta, r, b and epsilon, and M, m, k and c if one of these is
        known.
    describes : bool
        Whether the exact symmetric 1:1 motion describes the points: otherwise neither values nor uncertainties hold.
    chi_square, p_value : float
        Chi-square, and the probability of a larger one.
    degrees : int
        Degrees of freedom of chi-square.
    channels : dict of ndarray
        Of response, frequency and drive: chi_square, the value expected if the uncertainties are right, and p_value.
    correlations : ndarray
        Of f0, zeta, r, b and epsilon, shape (5, 5).
    residuals : ndarray
        Of the points over their standard uncertainties, shape (points, 3): response, frequency, drive.
    left_out : tuple of int
        Indices of the points that contradict the others and are left out, from 0.
    plant : dict
        The section `plant` of a scene, for `Scene(plant=...)`.
    undetermined : tuple of str
        Symbols of the first five parameters that the points do not determine: then `describes` says little.
    explained_by : str or None
        The effect of a real cavity that explains the points, where the ideal cavity does not describe them; several
        that do are joined by " or ".
    effects : dict of ndarray or None
        Of each effect that was tried then: effect, symbol, unit, strength, uncertainty, chi_square, degrees, left_out,
        describes, and possible_b_m, the half-width (m) that goes with it.
    alternatives : dict of ndarray
        The same columns: effects with which the points agree as well as with the ideal cavity, with another half-width.
    linear : tuple of dict
        Linear responses, with the state of the particle that agrees with the points, and the rises of chi-square with
        the particle carried along and free. A response whose state is `unknown` is left out.
    followed_periods : int or None
        Periods of recordings that the plant follows; None if the result is the fit of points.
    points_instead : str or None
        Why the points of recordings are fitted instead of the recordings themselves.
    parts : tuple of dict
        Parts of recordings: seconds, kind (held, sweep or decay), regime, and the point or None.
    """

    parameters: Table
    describes: bool
    chi_square: float
    p_value: float | None
    degrees: int
    channels: Table
    correlations: NDArray[np.float64]
    residuals: NDArray[np.float64]
    left_out: tuple[int, ...]
    plant: dict[str, float]
    undetermined: tuple[str, ...]
    explained_by: str | None
    effects: Table | None
    alternatives: Table
    linear: tuple[dict[str, Any], ...]
    followed_periods: int | None
    points_instead: str | None
    parts: tuple[dict[str, Any], ...]

    def __getitem__(self, symbol: str) -> tuple[float, float]:
        """Return value and standard uncertainty of a parameter, such as `fit["r"]`."""
        index = list(self.parameters["symbol"]).index(symbol)
        return float(self.parameters["value"][index]), float(self.parameters["uncertainty"][index])

    def plot(self, ax: Any = None) -> Any:
        """Draw the residuals point by point with matplotlib, and return the axes."""
        ax = axes(ax)
        for name, values in zip(("response", "frequency", "drive"), self.residuals.T, strict=True):
            ax.plot(values, "o", label=name)
        ax.set(xlabel="point", ylabel="residual over standard uncertainty")
        ax.legend()
        return ax


def fit(
    points: Mapping[str, Any] | Iterable[Mapping[str, Any]],
    scene: Scene | None = None,
    *,
    known: Mapping[str, float | tuple[float, float]] | None = None,
    linear: Iterable[Mapping[str, Any] | LinearDecay] = (),
) -> Fit:
    """Fit natural frequency, damping ratio, restitution, half-width and mass ratio to points, as `vines fit` does.

    Parameters
    ----------
    points : mapping or iterable of mappings
        Columns f_Hz, A_m (at the sensor), E_m or, of a force, F_N, and their standard uncertainties u_f_Hz, u_A_m,
        u_E_m or u_F_N: `backbone().points`, a DataFrame of pandas, or several locks such as `identify().lock`. Points
        that are not settled, or whose motion is not nonlinear and symmetric, are left out. The column phase_target_deg
        (degrees) says at which phase of the response relative to the base they were measured; without it, it is the
        scene's controller.phase_target.
    scene : Scene, optional
        Where the search begins; default: the default scene.
    known : mapping, optional
        Values from elsewhere by their symbols f0 (Hz), zeta, r, b (m), epsilon, M, m (kg), k (N/m) and c (N s/m): a
        number, which is kept, or a pair of value and standard uncertainty.
    linear : iterable, optional
        Linear responses beside those in columns of the points (tracked.csv): what `linear_decay` returns, or the
        mapping `linear` of tracked.json, of identification.json or of `vines check --json`.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        Too few points, a missing column, or a value that is not allowed.

    Examples
    --------
    >>> found = fit(backbone(Scene(backbone={"points": 8})).points, Scene(plant={"r": 0.75, "b": 0.011}))
    >>> found.describes, round(found["r"][0], 3), round(found["b"][0], 4)
    (True, 0.65, 0.01)
    """
    tables: list[Any] = [points] if isinstance(points, Mapping) or hasattr(points, "columns") else list(points)
    given = checked(scene)._native
    drive = "F_N" if given.drive_unit() == "N" else "E_m"
    names = ("A_m", "u_A_m", "f_Hz", "u_f_Hz", drive, f"u_{drive}")
    rows: list[list[float]] = []
    responses = list(linear)
    for table in tables:
        missing = [name for name in names if name not in table]
        if missing:
            raise ValueError(f"the points have no column {', '.join(missing)}; a fit needs {', '.join(names)}")
        columns = [np.atleast_1d(reals(name, table[name], name.rsplit("_", 1)[1], missing=True)) for name in names]
        kept = np.ones(columns[0].shape, dtype=bool)
        for name in ("settled", "reached"):
            if name in table:
                kept &= _truths(name, table[name])
        for name, words in _MOTIONS.items():
            if name in table:
                kept &= np.isin(np.atleast_1d(np.asarray(table[name])), words)
        columns.append(np.full(columns[0].shape, math.nan))
        if "phase_target_deg" in table:
            columns[-1][:] = table["phase_target_deg"]
        rows += np.column_stack(columns)[kept].tolist()
        if "linear_particle" in table and len(columns[0]):
            first = {name: np.atleast_1d(np.asarray(table[f"linear_{name}"]))[0] for name in _LINEAR}
            if isinstance(first["particle"], str) and first["particle"]:
                responses.append({name: float(first[name]) for name in _LINEAR[:5]} | {"particle": first["particle"]})
    for row in rows:
        row[2:4] = [math.tau * value for value in row[2:4]]
    return _result(_native.fit(given, rows, [], _texts(known), _responses(responses)))


def fit_recordings(
    recordings: Recording | Iterable[Recording],
    scene: Scene | None = None,
    *,
    known: Mapping[str, float | tuple[float, float]] | Iterable[str] | None = None,
) -> Fit:
    """Fit a rig to recordings, as `vines fit record.csv` does.

    Parameters
    ----------
    recordings : Recording or iterable of Recording
        What `read_recording` returns, or two channels of your own as a `Recording`.
    scene : Scene, optional
        What the sensors read, about which natural frequency and damping the structure has, and where the search begins.
    known : mapping, optional
        As of `fit`.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        Nothing but linear decays (see `linear_decay`), a recording without a stretch near phase resonance,
        a channel that is clipped or swapped, or too few points.
    """
    every = [recordings] if isinstance(recordings, Recording) else list(recordings)
    given = checked(scene)
    decays = [linear_decay(one, given) for one in every]
    kept = [one._tuple() for one, decay in zip(every, decays, strict=True) if decay is None]
    linear = [decay for decay in decays if decay is not None]
    if linear and not kept:
        origin = every[0].origin
        raise ValueError(f"{origin}: {linear[0]}; `linear_decay` returns these, and there are no points to fit")
    return _result(_native.fit(given._native, [], kept, _texts(known), _responses(linear)))


def _truths(name: str, values: Any) -> NDArray[np.bool_]:
    """Return a Boolean column; any other value is a `ValueError`."""
    given = np.atleast_1d(np.asarray(values, dtype=object)).ravel()
    found = [_native.truth(str(one)) for one in given]
    if None in found:
        row = found.index(None)
        raise ValueError(f"{name} = {given[row]!r} in row {row + 1}: True or False is allowed")
    return np.array(found, dtype=np.bool_)


#: Units of values from elsewhere.
_KNOWN_UNITS = {"f0": "Hz", "b": "m", "M": "kg", "m": "kg", "k": "N/m", "c": "N s/m"}


def _responses(linear: Iterable[Mapping[str, Any] | LinearDecay]) -> list[str]:
    def mapping(one: Mapping[str, Any] | LinearDecay) -> dict[str, Any]:
        if isinstance(one, LinearDecay):
            # A decay does not tell the state of the particle.
            return dict(zip(_LINEAR, (*one.f0, *one.zeta, 0.0, "unknown"), strict=True))
        numbers = zip(_LINEAR[:5], ("Hz", "Hz", "1", "1", "1"), strict=True)
        return {name: real(one[name], unit, name) for name, unit in numbers} | {"particle": one["particle"]}

    return list(dict.fromkeys(json.dumps(mapping(one)) for one in linear))


def _texts(known: Mapping[str, float | tuple[float, float]] | Iterable[str] | None) -> list[str]:
    if not isinstance(known, Mapping):
        return list(known or [])
    pairs = {name: value if isinstance(value, tuple) else (value, 0.0) for name, value in known.items()}
    numbers = {name: [real(one, _KNOWN_UNITS.get(name, "1"), name) for one in pair] for name, pair in pairs.items()}
    return [f"{name}={value}±{uncertainty}" for name, (value, uncertainty) in numbers.items()]


def _result(text: str) -> Fit:
    found = json.loads(text)
    report = found["report"]
    return Fit(
        parameters=_table(report["parameters"]),
        channels=_table(report["channels"]),
        correlations=np.array(report["correlations"]),
        residuals=np.array(report["residuals"]).reshape(-1, 3),
        left_out=tuple(number - 1 for number in report["left_out"]),
        plant=found["plant"],
        undetermined=tuple(report["undetermined"]),
        explained_by=found["explained_by"],
        effects=None if found["effects"] is None else _table(found["effects"]),
        alternatives=_table(found["alternatives"]),
        linear=tuple(found["linear"]),
        followed_periods=found["followed_periods"],
        points_instead=found["points_instead"],
        parts=tuple(part["part"] | {"point": part["point"]} for part in found["parts"]),
        **{key: report[key] for key in ("describes", "chi_square", "p_value", "degrees")},
    )
