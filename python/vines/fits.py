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
    """Every hypothesis about a rig, fitted to the same data, and the range of each parameter over the possible ones.

    Attributes
    ----------
    parameters : dict of ndarray
        symbol, unit, value, uncertainty and expected: f0, zeta, r, b and epsilon, and M, m, k and c if one of these is
        known. Value and uncertainty are the middle and half the width of the range over the hypotheses that are not
        excluded.
    hypotheses : dict of ndarray
        One row a hypothesis: hypothesis, its strength with symbol, unit and u_strength, the coefficient of the friction
        beside it and u_friction, its parameters f0, u_f0, zeta, u_zeta and so on, chi_square, degrees, p_value, and
        excluded, the reason or None. A number that a hypothesis does not have is NaN.
    channels : dict of ndarray
        One row a hypothesis and channel (responses, frequencies and drives of points, or a recording): hypothesis,
        channel, chi_square, the value expected if the uncertainties are right, and p_value.
    describes : bool
        Whether a cavity is possible, and a nonlinear spring without a particle is not.
    best : str
        The hypothesis of `plant`, `chi_square`, `p_value`, `degrees`, `correlations` and `residuals`: the ideal cavity
        if it is possible, otherwise the possible one with the smallest chi-square.
    chi_square, p_value : float
        Its chi-square, and the probability of a larger one.
    degrees : int
        Degrees of freedom of chi-square.
    correlations : ndarray
        Of f0, zeta, r, b and epsilon, shape (5, 5).
    residuals : ndarray
        Of the points over their standard uncertainties, shape (points, 3): response, frequency, drive.
    plant : dict
        The section `plant` of a scene, for `Scene(plant=...)`.
    undetermined : tuple of str
        Symbols of the first five parameters whose range, three times as wide, contains 0.
    not_fitted : tuple of str
        Hypotheses that are neither fitted nor excluded: the plant has no motions with these responses near the scene.
    linear : tuple of dict
        Linear responses, with the state of the particle that agrees with the data, and the rises of chi-square with
        the particle carried along and free. A response whose state is `unknown` is left out.
    stretches : tuple of dict
        Parts of recordings with one motion: seconds (begin and end), response_m (smallest and largest amplitude, m) and
        motion: 1:1, free, carried or other.
    """

    parameters: Table
    hypotheses: Table
    channels: Table
    describes: bool
    best: str
    chi_square: float
    p_value: float | None
    degrees: int
    correlations: NDArray[np.float64]
    residuals: NDArray[np.float64]
    plant: dict[str, float]
    undetermined: tuple[str, ...]
    not_fitted: tuple[str, ...]
    linear: tuple[dict[str, Any], ...]
    stretches: tuple[dict[str, Any], ...]

    def __getitem__(self, symbol: str) -> tuple[float, float]:
        """Return the value of a parameter and its standard uncertainty over the possible hypotheses: `fit["r"]`."""
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
    known: Mapping[str, float | tuple[float, float]] | Iterable[str] | None = None,
    linear: Iterable[Mapping[str, Any] | LinearDecay] = (),
    calibration: float = 0.01,
) -> Fit:
    """Fit every hypothesis about a rig to points of its backbone, as `vines fit` does.

    Parameters
    ----------
    points : mapping or iterable of mappings
        Columns f_Hz, A_m (at the sensor), E_m or, of a force, F_N, and their standard uncertainties u_f_Hz, u_A_m,
        u_E_m or u_F_N: `backbone().points`, a DataFrame of pandas, or several locks such as `identify().lock`. Points
        that are not settled, or whose motion is not nonlinear and symmetric, are left out. The column phase_target_deg
        (degrees) says at which phase of the response relative to the base they were measured; without it, it is the
        scene's controller.phase_target.
    scene : Scene, optional
        Where the search begins; default: the default scene. For points that vines has not measured, it says what the
        sensor reads: `Scene(resonance={"sensor": "q1"})`.
    known : mapping, optional
        Values from elsewhere by their symbols f0 (Hz), zeta, r, b (m), epsilon, M, m (kg), k (N/m) and c (N s/m), and
        strengths of hypotheses: mu (friction), theta (tilt, degrees), k_r (viscoelastic, (s/m)^(1/5)), v_y (plastic,
        m/s), h (cubic stiffness) and g (gain of the reference). A number is exact, a pair is a value and its standard
        uncertainty. A strength of 0 excludes its hypothesis: {"mu": 0}. Or texts such as "m=0.032±0.0003".
    linear : iterable, optional
        Linear responses beside those in columns of the points (tracked.csv): what `linear_decay` returns, or the
        mapping `linear` of tracked.json, of identification.json or of `vines check --json`.
    calibration : float, optional
        Standard uncertainty of the gain of the reference, relative.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        Too few points, a missing column, a value that is not allowed, or a scene that does not say what the sensor is.

    Examples
    --------
    >>> points = backbone(Scene(backbone={"points": 8})).points
    >>> found = fit(points, Scene(plant={"r": 0.75, "b": 0.011}), known={"mu": 0, "b": (0.01, 5e-5)})
    >>> found.describes, found.best, round(found["r"][0], 2), round(found["epsilon"][0], 4)
    (True, 'ideal cavity', 0.65, 0.0084)
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
        if not ({"C", "sigma"} <= set(table)):
            given.requires_sensor("the points")
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
    return _fit(checked(scene), rows, [], known, responses, calibration)


def fit_recordings(
    recordings: Recording | Iterable[Recording],
    scene: Scene | None = None,
    *,
    known: Mapping[str, float | tuple[float, float]] | Iterable[str] | None = None,
    calibration: float = 0.01,
) -> Fit:
    """Fit every hypothesis about a rig to recordings, as `vines fit record.csv` does.

    Parameters
    ----------
    recordings : Recording or iterable of Recording
        What `read_recording` returns, or two channels of your own as a `Recording`.
    scene : Scene, optional
        What the sensors read, and about which rig was recorded: f0 within 1 %, b within 10 %, masses within 15 %. For
        recordings that vines has not made, it needs `resonance.sensor`: `Scene(resonance={"sensor": "q1"})`.
    known, calibration : optional
        As of `fit`.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        Nothing but linear decays (see `linear_decay`), a recording with fewer than thirty periods of symmetric 1:1
        motion, or a channel that is clipped or swapped.
    """
    every = [recordings] if isinstance(recordings, Recording) else list(recordings)
    given = checked(scene)
    decays = [linear_decay(one, given) for one in every]
    kept = [one._tuple() for one, decay in zip(every, decays, strict=True) if decay is None]
    linear = [decay for decay in decays if decay is not None]
    if linear and not kept:
        origin = every[0].origin
        raise ValueError(f"{origin}: {linear[0]}; `linear_decay` returns these, and there is nothing else to fit")
    return _fit(given, [], kept, known, linear, calibration)


def _truths(name: str, values: Any) -> NDArray[np.bool_]:
    """Return a Boolean column; any other value is a `ValueError`."""
    given = np.atleast_1d(np.asarray(values, dtype=object)).ravel()
    found = [_native.truth(str(one)) for one in given]
    if None in found:
        row = found.index(None)
        raise ValueError(f"{name} = {given[row]!r} in row {row + 1}: True or False is allowed")
    return np.array(found, dtype=np.bool_)


#: Units of values from elsewhere, and of strengths of hypotheses.
_KNOWN_UNITS = {"f0": "Hz", "b": "m", "M": "kg", "m": "kg", "k": "N/m", "c": "N s/m", "theta": "deg", "v_y": "m/s"}


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


def _fit(
    scene: Scene,
    points: list[list[float]],
    recordings: list[tuple[Any, ...]],
    known: Mapping[str, float | tuple[float, float]] | Iterable[str] | None,
    linear: Iterable[Mapping[str, Any] | LinearDecay],
    calibration: float,
) -> Fit:
    share = real(calibration, "1", "calibration")
    found = json.loads(_native.fit(scene._native, points, recordings, _texts(known), _responses(linear), share))
    report = found["report"]
    rows = report["hypotheses"]
    of_channels = [{"hypothesis": row["hypothesis"]} | channel for row in rows for channel in row["channels"]]
    return Fit(
        parameters=_table(report["parameters"]),
        hypotheses=_hypotheses(rows),
        channels=_table(of_channels),
        correlations=np.array(report["correlations"]),
        residuals=np.array(report["residuals"]).reshape(-1, 3),
        plant=found["plant"],
        undetermined=tuple(report["undetermined"]),
        not_fitted=tuple(report.get("not_fitted", ())),
        linear=tuple(found["linear"]),
        stretches=tuple(found["stretches"]),
        **{key: report[key] for key in ("describes", "best", "chi_square", "p_value", "degrees")},
    )


def _hypotheses(rows: list[dict[str, Any]]) -> Table:
    """Return one row a hypothesis, with a column for each parameter and its standard uncertainty."""
    symbols = dict.fromkeys(one["symbol"] for row in rows for one in row["parameters"])

    def flat(row: dict[str, Any]) -> dict[str, Any]:
        values = {one["symbol"]: one for one in row["parameters"]}
        columns: dict[str, Any] = {}
        for symbol in symbols:
            one = values.get(symbol, {})
            columns |= {symbol: one.get("value"), f"u_{symbol}": one.get("uncertainty")}
        before = ("hypothesis", "symbol", "unit", "strength", "u_strength", "friction", "u_friction")
        return (
            {name: row[name] for name in before}
            | columns
            | {name: row[name] for name in ("chi_square", "degrees", "p_value")}
        )

    table = _table([flat(row) for row in rows])
    table["excluded"] = np.array([row["excluded"] for row in rows], dtype=object)
    return table
