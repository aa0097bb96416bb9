"""Structures: as plants, and modal tests in universal files (UFF 55) as the section `[structure]` of a scene."""

import operator
import warnings
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ._native import StructurePlant as _StructurePlant
from .numbers import real
from .packages import package
from .scenes import Scene

_DIRECTIONS = ("X", "Y", "Z", "RX", "RY", "RZ")
_TRANSLATIONS = 3


def structure_from_uff(path: str | PathLike[str], *, units: str | None = None) -> dict[str, Any]:
    """Read the modes of a modal test from a universal file, with mass-normalised shapes in 1/sqrt(kg).

    Parameters
    ----------
    path : path-like
        A file with data sets 55 of normal modes or of complex eigenvalues, and their units in data set 164. Needs
        `vines-testbench[io]`.
    units : str, optional
        "SI" where the file does not state its units.

    Returns
    -------
    dict
        `modes`, as a scene has them: frequency (Hz), damping (ratio), shape by points such as "12Z", and
        `out_of_phase`, the share of every shape that is left out, because a scene has real shapes.

    Warns
    -----
    UserWarning
        For every mode with a share that is left out.

    Raises
    ------
    ValueError
        Units that are not known; a file without modes; a mode without modal mass.
    ImportError
        pyuff is not installed.
    """
    file = Path(path)
    if not file.is_file():
        raise ValueError(f"cannot read {file}: it is no file")
    pyuff = package("pyuff")
    try:
        sets = pyuff.UFF(str(file)).read_sets()
    except Exception as error:
        raise ValueError(f"{file} cannot be read as UFF: {error}") from error
    sets = sets if isinstance(sets, list) else [sets]
    mass = _kilograms(file, sets, units)
    modes = [one for one in sets if one.get("type") == 55 and one.get("analysis_type") in (2, 3)]
    if not modes:
        raise ValueError(
            f"{file} has no data set 55 of normal modes or complex eigenvalues: export the modes, not the responses"
        )
    read = [_mode(file, number, one, mass) for number, one in enumerate(modes, 1)]
    for number, (_, _, share) in enumerate(read, 1):
        if note := _left_out(number, share):
            warnings.warn(f"{file}: {note}", stacklevel=2)
    points = sorted({point for _, shape, _ in read for point, value in shape.items() if value != 0.0}, key=_order)
    return {
        "modes": [{**mode, "shape": {point: shape.get(point, 0.0) for point in points}} for mode, shape, _ in read],
        "out_of_phase": [share for *_, share in read],
    }


def scene_from_uff(path: str | PathLike[str], cavity: str, drive: str, *, units: str | None = None) -> str:
    """Return a scene (TOML) with the structure of a universal file, a force at `drive`, and the default particle.

    Parameters
    ----------
    path : path-like
        As in `structure_from_uff`.
    cavity, drive : str
        The points of cavity and force, such as "12Z".
    units : str, optional
        As in `structure_from_uff`.

    Returns
    -------
    str
        The text of a scene file.
    """
    found = structure_from_uff(path, units=units)
    points = list(found["modes"][0]["shape"])
    for key, point in (("cavity", cavity), ("drive", drive)):
        if point not in points:
            raise ValueError(f"{key}: {point} is no point of {path}; its points are {', '.join(points)}")
    lines = [
        f"# The structure is from {Path(path).name}; the particle is the default scene's.",
        "[plant]",
        "m = 0.032",
        "b = 0.01",
        "r = 0.65",
        "",
        "[structure]",
        'excitation = "force"',
        f'cavity = "{cavity}"',
        f'drive = "{drive}"',
        "modes = [",
    ]
    for number, (mode, share) in enumerate(zip(found["modes"], found["out_of_phase"], strict=True), 1):
        if note := _left_out(number, share):
            lines.append(f"    # {note}")
        shape = ", ".join(f'"{point}" = {value:.9e}' for point, value in mode["shape"].items())
        lines.append(
            f"    {{ frequency = {mode['frequency']:.9e}, damping = {mode['damping']:.9e}, shape = {{ {shape} }} }},"
        )
    return "\n".join([*lines, "]", "", "[excitation]", "G = 1.1", ""])


def _left_out(number: int, share: float) -> str:
    """Say what is left out of a complex shape, as `vines structure` does; nothing below a tenth of a per cent."""
    percent = f"{100 * share:.1f}"
    return f"mode {number}: {percent} % of the shape are out of phase and left out" if float(percent) else ""


def _kilograms(file: Path, sets: list[dict[str, Any]], units: str | None) -> float:
    """Kilograms per unit of mass of the file."""
    stated = next((one for one in sets if one.get("type") == 164), None)
    if units is not None:
        if units.upper() != "SI":
            raise ValueError(f"units = {units!r}: give SI, or a data set 164 in the file for others")
        return 1.0
    if stated is None:
        raise ValueError(f"the units of {file} are unknown: it has no data set 164; give units SI if masses are in kg")
    length, force = (float(stated.get(key) or 0.0) for key in ("length", "force"))
    if not (length > 0.0 and force > 0.0):
        raise ValueError(f"the units of {file} are unknown: its data set 164 has the factors {length} and {force}")
    # Values of the file over the factors are in SI units, and a mass is a force over a length (and 1/s²).
    return length / force


def _mode(
    file: Path, number: int, one: dict[str, Any], kilograms: float
) -> tuple[dict[str, float], dict[str, float], float]:
    """Frequency and damping, the shape, and the share of it that is out of phase."""
    values = np.array(
        [np.atleast_1d(one.get(f"r{n}", 0.0)) + 0j for n in range(1, _TRANSLATIONS + 1) if f"r{n}" in one]
    )
    nodes = [int(node) for node in np.atleast_1d(one["node_nums"])]
    if one["analysis_type"] == 2:
        frequency, damping = float(one["freq"]), float(one.get("modal_damp_vis") or 0.0)
        damping = damping or 0.5 * float(one.get("modal_damp_his") or 0.0)
        mass = complex(one.get("modal_m") or 0.0)
    else:
        pole = complex(one["eig"])
        frequency, damping = abs(pole) / (2 * np.pi), -pole.real / abs(pole)
        # Modal A of a real mode is 2 i omega_d times its mass.
        mass = complex(one.get("modal_a") or 0.0) / (2j * abs(pole.imag)) if pole.imag else 0j
    if not abs(mass) > 0.0:
        raise ValueError(
            f"mode {number} of {file} has no modal mass: its shape cannot be mass-normalised; export it scaled"
        )
    shape = values / np.sqrt(mass * kilograms)
    share = float(np.linalg.norm(shape.imag) / (np.linalg.norm(shape) or 1.0))
    points = {
        f"{node}{_DIRECTIONS[row]}": float(shape[row, n].real)
        for row in range(len(shape))
        for n, node in enumerate(nodes)
    }
    return {"frequency": frequency, "damping": damping}, points, share


def _order(point: str) -> tuple[int, str]:
    digits = point.rstrip("XYZR")
    return int(digits), point[len(digits) :]


class StructurePlant(_StructurePlant):
    """One structure with its particle, and with its shaker if the scene has one, from rest.

    The drive is the displacement of the base, m, the force, N, or with a shaker the command of its amplifier, V, which
    is clipped at the amplifier's limit. The other limits of the shaker (force, stroke, current or voltage) are checked
    at the end of every step, and within a longer step at least once per sample time of the scene.

    Parameters
    ----------
    scene : Scene
        A scene with `[structure]` or `[shaker]`.

    Raises
    ------
    ValueError
        A scene with one oscillator: it is a `Plant`.

    Examples
    --------
    >>> oscillator = "[plant]; M = 3.8; k = 11680; c = 2.5; m = 0.032; b = 0.01; r = 0.65; [excitation]; G = 1.1"
    >>> table = "[shaker]; mass = 9; stiffness = 9e4; stinger_stiffness = 3e7; table_mass = 4; resistance = 1; Bl = 120"
    >>> plant = StructurePlant(Scene(text=f"{oscillator}; {table}".replace("; ", "\\n")))
    >>> plant.channels
    {'drive': 'V', 'mass': 'm', 'table': 'm', 'armature': 'm', 'force': 'N', 'current': 'A'}
    >>> motion = plant.trajectory(1.0, 1000, amplitude=2.0, omega=54.9)
    >>> float(abs(motion["force"]).max()) > 1
    True
    >>> plant["force"] == float(motion["force"][-1])
    True
    """

    _last: NDArray[np.float64]

    def __new__(cls, scene: Scene) -> Self:
        plant = super().__new__(cls, scene._native)
        plant._last = plant._trajectory(0.0, 0, (0.0, 0.0, 0.0))[-1]
        return plant

    @property
    def channels(self) -> dict[str, str]:
        """Names of the drive, the points and what is measured at the shaker, with their units."""
        return dict(self._channels())

    def _columns(self) -> list[str]:
        drive, *channels = self.channels
        return ["time", drive, "q2", "impacts", *channels]

    def __getitem__(self, name: str) -> float:
        """Return a channel, or `time` (s), `q2` (m) or `impacts`, now."""
        columns = self._columns()
        if name not in columns:
            raise KeyError(f"{name!r} is no channel; known are {', '.join(columns)}")
        return float(self._last[columns.index(name)])

    def advance(self, duration: float, *, held: float = 0.0, amplitude: float = 0.0, omega: float = 0.0) -> None:
        """Advance it under the drive held + E sin(phase + omega t), whose phase continues from call to call.

        Parameters
        ----------
        duration : float
            Duration, s.
        held, amplitude : float
            Held part and amplitude E of the drive, m, N or V.
        omega : float
            Angular frequency, rad/s.

        Raises
        ------
        ValueError
            A value that is not allowed. The plant is not advanced then.
        RuntimeError
            The shaker passed a limit at one of the instants at which limits are checked. The plant is not advanced
            then.
        """
        self.trajectory(duration, 1, held=held, amplitude=amplitude, omega=omega)

    def trajectory(
        self, duration: float, steps: int, *, held: float = 0.0, amplitude: float = 0.0, omega: float = 0.0
    ) -> dict[str, NDArray[np.float64]]:
        """Advance it in equal steps, and return `time`, `q2`, `impacts` and all channels by name.

        They are those at the start and after every step.

        Parameters
        ----------
        duration : float
            Duration of all steps, s.
        steps : int
            Number of steps, 1 to 10^7.
        held, amplitude, omega : float
            As of `advance`.

        Returns
        -------
        dict of ndarray

        Raises
        ------
        ValueError, RuntimeError
            As of `advance`.
        """
        if not 1 <= operator.index(steps) <= 10**7:
            raise ValueError(f"steps = {steps}: a whole number from 1 to 10^7 is allowed")
        unit = self.channels["drive"]
        drive = real(held, unit, "held"), real(amplitude, unit, "amplitude"), omega
        rows = self._trajectory(duration, steps, drive)
        self._last = rows[-1]
        return dict(zip(self._columns(), np.ascontiguousarray(rows.T), strict=True))
