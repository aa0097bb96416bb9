"""Recordings of two channels over time: CSV, MAT, HDF5, TDMS and UFF58, as arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
_TIMES = ("time", "t", "Time")
_NEEDED = {"scipy.io": "MAT 5", "h5py": "MAT 7.3 and HDF5", "nptdms": "TDMS", "pyuff": "UFF58"}


@dataclass(frozen=True)
class Recording:
    """Two channels of a measurement, sampled at equal distances.

    Attributes
    ----------
    origin : str
        Where it comes from, for messages: the name of a file.
    channels : tuple of str
        Names of the channels of response and base, for messages.
    sample_time : float
        Time from sample to sample, s.
    response, drive : ndarray
        Response and displacement of the base, m.
    """

    origin: str
    channels: tuple[str, str]
    sample_time: float
    response: NDArray[np.float64]
    drive: NDArray[np.float64]


def read_recording(
    path: str | PathLike[str],
    response: str = "response",
    drive: str = "reference",
    *,
    rate: float | None = None,
    time: str | None = None,
) -> Recording:
    """Read a recording from a file, by its extension.

    Parameters
    ----------
    path : path-like
        A file .csv, .mat (5 and 7.3), .h5, .hdf5, .tdms, .uff or .unv. All but CSV need `vines-testbench[io]`.
    response, drive : str
        Names of the channels of the response and of the displacement of the base, each with a unit m, mm or um, or with
        metres per unit, after a colon: "y:mm", "x:-1". In HDF5 and TDMS a name may be a path, such as "group/y".
    rate : float, optional
        Samples a second. Without it the file says it: a channel `time` (s), the increment of a TDMS or UFF58 channel.
    time : str, optional
        Name of the channel of the time, s.

    Returns
    -------
    Recording

    Raises
    ------
    ValueError
        A file without one of the channels, or without a time.
    ImportError
        A package that is not installed.
    """
    file = Path(path)
    read = _READERS.get(file.suffix.lower())
    if read is None:
        raise ValueError(
            f"{file}: the format {file.suffix or 'without extension'} is unknown; {', '.join(_READERS)} are"
        )
    channels, increment = read(file)
    names, values = [], []
    for text, option in ((response, "response"), (drive, "drive")):
        name, factor = _parsed(text)
        names.append(name)
        values.append(factor * _channel(file, channels, name, option))
    step = 1.0 / rate if rate is not None else _step(file, channels, time, increment.get(names[0]))
    return Recording(str(file), (names[0], names[1]), step, *values)


def _parsed(text: str) -> tuple[str, float]:
    name, colon, unit = text.rpartition(":")
    if not colon:
        return text, 1.0
    if unit in _UNITS:
        return name, _UNITS[unit]
    try:
        factor = float(unit)
    except ValueError:
        factor = 0.0
    if factor == 0.0 or not np.isfinite(factor):
        raise ValueError(
            f"{text}: the unit {unit} is unknown; m, mm and um are known, or metres per unit, as in {name}:0.5"
        )
    return name, factor


def _channel(file: Path, channels: Mapping[str, Any], name: str, option: str) -> NDArray[np.float64]:
    if name not in channels:
        raise ValueError(f"{file} has no channel {name}; it has {', '.join(channels)}. Name the channel with {option}=")
    try:
        values = np.asarray(channels[name], dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{file}, channel {name}: its values are not real numbers; name another channel") from None
    if values.size != max(values.shape, default=0):
        raise ValueError(
            f"{file}, channel {name} has the shape {values.shape}: a channel is one row or column of numbers"
        )
    return np.ascontiguousarray(values.ravel())


def _step(file: Path, channels: Mapping[str, Any], time: str | None, increment: float | None) -> float:
    names: Sequence[str] = _TIMES if time is None else (time,)
    name = next((one for one in names if one in channels), None)
    if name is None:
        if time is None and increment:
            return increment
        raise ValueError(
            f"{file} has no channel {' or '.join(names)} with the time in seconds; give rate= (samples a second)"
        )
    times = _channel(file, channels, name, "time")
    if times.size < 2:
        raise ValueError(f"{file}, channel {name} has {times.size} values: a recording has more")
    steps = np.diff(times)
    step = float(times[-1] - times[0]) / (times.size - 1)
    uneven = np.flatnonzero(~(np.abs(steps / step - 1.0) <= 0.01))
    if uneven.size:
        n = int(uneven[0])
        raise ValueError(
            f"{file}, channel {name}: the time goes from {times[n]:g} s to {times[n + 1]:g} s, a step is {step:.6g} s: "
            "the recording is interrupted there; fit the parts as files of their own"
        )
    return step


def _package(name: str) -> Any:
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = name.partition(".")[0]
        raise ImportError(f"{_NEEDED[name]} need the package {package}: pip install './python[io]'") from error


_Channels = tuple[dict[str, Any], dict[str, float]]


def _csv(file: Path) -> _Channels:
    with file.open(encoding="utf-8") as lines:
        names = [name.strip() for name in next(lines, "").split(",")]
        rows = [line.split(",") for line in lines if line.strip()]
    for number, row in enumerate(rows, 2):
        if len(row) != len(names):
            raise ValueError(f"{file}, line {number} has {len(row)} values, and the header has {len(names)} names")
    columns: list[Any] = [[one.strip() for one in column] for column in zip(*rows, strict=True)]
    return dict(zip(names, columns, strict=False)), {}


def _mat(file: Path) -> _Channels:
    if file.read_bytes()[:128].startswith(b"MATLAB 7.3"):
        return _hdf5(file)
    try:
        found = _package("scipy.io").loadmat(file)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{file} cannot be read as a MAT file: {error}") from error
    return {name: value for name, value in found.items() if not name.startswith("__")}, {}


def _hdf5(file: Path) -> _Channels:
    h5py = _package("h5py")
    channels: dict[str, Any] = {}
    try:
        with h5py.File(file) as content:

            def keep(name: str, one: Any) -> None:
                if isinstance(one, h5py.Dataset) and one.dtype.kind in "fiu":
                    channels[name] = one[()]

            content.visititems(keep)
    except OSError as error:
        raise ValueError(f"{file} cannot be read as HDF5: {error}") from error
    return channels, {}


def _tdms(file: Path) -> _Channels:
    tdms = _package("nptdms").TdmsFile.read(file)
    found = {f"{group.name}/{channel.name}": channel for group in tdms.groups() for channel in group.channels()}
    return _short(
        {name: channel[:] for name, channel in found.items()},
        {name: float(channel.properties.get("wf_increment", 0.0)) for name, channel in found.items()},
    )


def _uff(file: Path) -> _Channels:
    sets = _package("pyuff").UFF(str(file)).read_sets()
    channels, increments = {}, {}
    for number, one in enumerate(sets if isinstance(sets, list) else [sets], 1):
        if one.get("type") != 58:
            continue
        name = str(one.get("id1") or one.get("rsp_ent_name") or number).strip()
        channels[name], increments[name] = np.real(one["data"]), float(one.get("abscissa_inc") or 0.0)
    return channels, increments


def _short(channels: dict[str, Any], increments: dict[str, float]) -> _Channels:
    """Add the last part of a path as a name, where it is the only one."""
    last = [name.rpartition("/")[2] for name in channels]
    for name, short in zip(list(channels), last, strict=True):
        if last.count(short) == 1:
            channels[short], increments[short] = channels[name], increments[name]
    return channels, increments


_READERS = {
    ".csv": _csv,
    ".mat": _mat,
    ".h5": _hdf5,
    ".hdf5": _hdf5,
    ".tdms": _tdms,
    ".uff": _uff,
    ".unv": _uff,
}
