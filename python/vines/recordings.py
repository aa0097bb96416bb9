"""Recordings of two channels over time: MAT, HDF5, TDMS, UFF58 and LVM are read here, CSV by the compiled part."""

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from .scenes import Scene, checked

_NEEDED = {"pymatreader": "MAT", "h5py": "HDF5", "nptdms": "TDMS", "pyuff": "UFF", "lvm_read": "LVM"}
# SI units of what an ordinate of UFF58 is, for files without labels.
_UFF_UNITS = {8: "m", 9: "N", 11: "m/s", 12: "m/s²", 13: "N"}
_UFF_TYPES = {
    2: "an auto spectrum",
    3: "a cross spectrum",
    4: "a frequency response function",
    9: "a power spectral density",
}


@dataclass(frozen=True)
class Recording:
    """Two channels of a measurement, sampled at equal distances.

    Attributes
    ----------
    origin : str
        Where it comes from, for messages: the name of a file.
    channels : tuple of str
        Names of the channels of response and base, for messages; the second is empty if the base rests.
    sample_time : float
        Time from sample to sample, s.
    response, drive : ndarray
        Response and base, m, m/s or m/s².
    start : float
        Time of the first sample, s.
    measured : tuple of str
        What response and base are: "displacement", "velocity" or "acceleration".
    notes : tuple of str
        What is to be known of the way it was read: the clock, and what was cut or interpolated.
    """

    origin: str
    channels: tuple[str, str]
    sample_time: float
    response: NDArray[np.float64]
    drive: NDArray[np.float64]
    start: float = 0.0
    measured: tuple[str, str] = ("displacement", "displacement")
    notes: tuple[str, ...] = ()

    def _tuple(self) -> tuple[Any, ...]:
        clock = [self.start, self.sample_time]
        values = (np.asarray(one, dtype=np.float64).ravel() for one in (self.response, self.drive))
        return self.origin, list(self.channels), clock, list(self.measured), *values, list(self.notes)


@dataclass(frozen=True)
class LinearDecay:
    """Natural frequency (Hz) and damping ratio of a free decay, each with its standard uncertainty."""

    f0: tuple[float, float]
    zeta: tuple[float, float]
    text: str

    def __str__(self) -> str:
        """Return one sentence."""
        return self.text


def linear_decay(recording: Recording, scene: Scene | None = None) -> LinearDecay | None:
    """Evaluate a free decay with the base at rest; None if the base moves, or if the particle hits the walls.

    Parameters
    ----------
    recording : Recording
        What `read_recording` returns; without a channel of the base the base rests.
    scene : Scene, optional
        About which natural frequency the structure has, within a few per cent.

    Returns
    -------
    LinearDecay or None
    """
    found = _native.linear_decay(checked(scene)._native, recording._tuple())
    if found is None:
        return None
    (f0, u_f0, zeta, u_zeta), text = found
    return LinearDecay((f0, u_f0), (zeta, u_zeta), text)


def read_recording(
    path: str | PathLike[str],
    response: str | None = None,
    drive: str | None = None,
    *,
    rate: float | None = None,
    time: str | None = None,
    late: float | None = None,
) -> Recording:
    """Read a recording from a file, by its extension.

    Parameters
    ----------
    path : path-like
        A file .csv, .txt, .dat, .mat (5 and 7.3), .h5, .hdf5, .tdms, .uff, .unv or .lvm. All but tables as text need
        `vines-testbench[io]`.
    response, drive : str, optional
        Channels of the response and of the base, by default `response` and `reference`: a name or a number, and after a
        colon a unit if the file has none (m, mm, µm, mm/s, m/s², g) or a multiple of it ("-1g"), the sensitivity of the
        sensor ("100mV/g", "125mm/s/V"), or metres per unit ("-0.5"). The last part of a path is enough where it is the
        only one. Without a channel of the base the base rests.
    rate : float, optional
        Samples a second. Without it the file says it: a channel of the time, or the clock of a channel in TDMS,
        UFF58 or LVM.
    time : str, optional
        Channel of the time, by default `time` or `t`.
    late : float, optional
        Time by which the channel of the base is later than that of the response, s: channels that a logger samples in
        turn. Nothing in a recording shows it.

    Returns
    -------
    Recording

    Raises
    ------
    ValueError
        A file without one of the channels, or without a time. The message has the channels as they were read.
    ImportError
        A package that is not installed.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in _READERS:
        raise ValueError(f"{file}: the format {suffix or 'without extension'} is unknown; {', '.join(_READERS)} are")
    read, channels = _READERS[suffix], None
    if read is not None:
        if not file.is_file():
            raise ValueError(f"cannot read {file}: it is no file")
        try:
            every = list(read(file))
        except ImportError:
            raise
        except Exception as error:
            raise ValueError(f"{file} cannot be read as {suffix[1:].upper()}: {error}") from error
        channels = [_tuple(*one) for one in every if not isinstance(one[1], str)]
        refused = {name: reason for name, reason, *_ in every if isinstance(reason, str)}
        for text in (response, drive, time):
            name = (text or "").lstrip("/")
            for asked in (name, name.rpartition(":")[0]):
                if asked in refused:
                    raise ValueError(f"{file}, channel {asked}: {refused[asked]}")
        if not channels:
            reasons = "; ".join(f"{name}: {reason}" for name, reason in refused.items())
            raise ValueError(f"{file} has no channel of numbers{': ' if reasons else ''}{reasons}")
    origin, names, (start, step), measured, y, x, notes = _native.recording(
        str(file), channels, [response, drive, time], rate, late
    )
    pair = (measured[0], measured[1])
    return Recording(origin, (names[0], names[1]), step, np.array(y), np.array(x), start, pair, tuple(notes))


# A channel of a file: name, samples or the reason why it has none, unit, and start and step of its clock.
_Channel = tuple[Any, ...]


def _tuple(name: str, values: Any, unit: str = "", clock: tuple[float, float] | None = None) -> _Channel:
    return name, unit, np.ascontiguousarray(values, dtype=np.float64), None if clock is None else list(clock)


def _columns(name: str, values: Any, unit: str = "", factor: float = 1.0, offset: float = 0.0) -> Iterator[_Channel]:
    """Channels of an array: itself, its fields, or its columns with numbers from 1; the longer side is the time."""
    array = np.asarray(values)
    if array.dtype.names:
        for field in array.dtype.names:
            yield from _columns(f"{name}/{field}", array[field], unit)
    elif array.dtype.kind == "M":
        yield name, (array - array.ravel()[0]) / np.timedelta64(1, "s"), "s"
    elif array.dtype.kind == "c":
        yield name, "its values are complex, as of a spectrum; a recording has real samples over time"
    elif array.dtype.kind not in "fiu":
        yield name, f"its values are no numbers ({array.dtype})"
    elif array.size == max(array.shape, default=0):
        yield name, array.ravel() * factor + offset, unit
    elif array.ndim == 2:
        table = array if array.shape[0] >= array.shape[1] else array.T
        for number, column in enumerate(table.T[:1000], 1):
            yield f"{name}/{number}", column * factor + offset, unit
    else:
        yield name, f"it has the shape {array.shape}; a channel is one row or column of numbers"


def _package(name: str) -> Any:
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"{_NEEDED[name]} needs the package {name}: pip install './python[io]'") from error


def _mat(file: Path) -> Iterator[_Channel]:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = _package("pymatreader").read_mat(file)
    return _variables("", {name: value for name, value in found.items() if not name.startswith(("__", "#"))})


def _variables(name: str, value: Any) -> Iterator[_Channel]:
    """Channels of a variable of MATLAB: structures, lists of them, and "structure with time" of Simulink."""
    if isinstance(value, Mapping):
        labels = value.get("label", [])
        labels = [labels] if isinstance(labels, str) else list(labels) if isinstance(labels, list) else []
        signals = list(_columns(name, value["values"])) if labels and "values" in value else []
        if len(labels) == len(signals) > 0 and all(isinstance(label, str) and label for label in labels):
            yield from ((label, *one[1:]) for label, one in zip(labels, signals, strict=True))
            return
        for key, one in value.items():
            yield from _variables(f"{name}.{key}" if name else str(key), one)
    elif isinstance(value, list) and value and isinstance(value[0], Mapping):
        for number, one in enumerate(value, 1):
            yield from _variables(f"{name}.{number}", one)
    elif value is None or type(value).__name__ in ("MatlabOpaque", "MatlabFunction"):
        yield (
            name,
            "it is an object of MATLAB, such as a table or a timetable: save it as a structure, "
            "s = table2struct(T, 'ToScalar', true), or as a table of text with writetable or writetimetable",
        )
    elif not isinstance(value, str):
        yield from _columns(name, value)


def _hdf5(file: Path) -> Iterator[_Channel]:
    h5py = _package("h5py")
    with h5py.File(file) as content:
        yield from _group(h5py, content, "", frozenset())


def _group(h5py: Any, group: Any, path: str, above: frozenset[Any]) -> Iterator[_Channel]:
    for name in group:
        full = f"{path}{name}"
        # Follows soft and external links.
        try:
            one = group[name]
        except (KeyError, OSError):
            yield full, "it is a link to something that does not exist"
            continue
        if isinstance(one, h5py.Group) and one.id not in above:
            yield from _group(h5py, one, f"{full}/", above | {group.id})
        elif isinstance(one, h5py.Dataset):
            unit = next((one.attrs[key] for key in ("units", "unit", "Units", "Unit") if key in one.attrs), "")
            unit = unit.decode() if isinstance(unit, bytes) else str(unit)
            factor, offset = (
                float(np.ravel(one.attrs.get(key, d))[0]) for key, d in (("scale_factor", 1), ("add_offset", 0))
            )
            yield from _columns(full, one[()], unit, factor, offset)


def _tdms(file: Path) -> Iterator[_Channel]:
    channels = [channel for group in _package("nptdms").TdmsFile.read(file).groups() for channel in group.channels()]
    starts = [one.properties.get("wf_start_time") for one in channels]
    # A channel without a waveform begins with the others.
    first = min((np.datetime64(start) for start in starts if start is not None), default=None)
    for channel, start in zip(channels, starts, strict=True):
        step = float(channel.properties.get("wf_increment", 0.0))
        later = 0.0 if start is None else float((np.datetime64(start) - first) / np.timedelta64(1, "s"))
        clock = (later + float(channel.properties.get("wf_start_offset", 0.0)), step) if step > 0.0 else None
        unit = str(channel.properties.get("unit_string", ""))
        for name, values, *rest in _columns(f"{channel.group_name}/{channel.name}", channel[:], unit):
            yield name, values, *rest, clock


def _uff(file: Path) -> Iterator[_Channel]:
    sets = _package("pyuff").UFF(str(file)).read_sets()
    functions = [one for one in (sets if isinstance(sets, list) else [sets]) if one.get("type") == 58]
    directions = {n: f"{'+' if n > 0 else '-'}{'XYZ'[(abs(n) - 1) % 3]}" for n in range(-6, 7) if n}

    def texts(key: str) -> list[str]:
        given = [str(one.get(key) or "").strip() for one in functions]
        return [text if text.upper() != "NONE" else "" for text in given]

    nodes = [f"{one.get('rsp_node')}{directions.get(int(one.get('rsp_dir') or 0), '')}" for one in functions]
    numbers = [str(number) for number in range(1, len(functions) + 1)]
    kinds = [texts("id1"), nodes, texts("rsp_ent_name"), numbers]
    names = next(kind for kind in kinds if all(kind) and len(set(kind)) == len(kind))
    uneven = {}
    for name, one in zip(names, functions, strict=True):
        kind = int(one.get("func_type") or 0)
        abscissa = int(one.get("abscissa_spec_data_type") or 0)
        if kind != 1 and not (kind == 0 and abscissa in (0, 17)):
            what = _UFF_TYPES.get(kind, f"a function of type {kind}")
            yield name, f"it is {what} (func_type {kind}), not a time response (1)"
            continue
        unit = str(one.get("ordinate_axis_units_lab") or "").strip()
        if unit.upper() in ("", "NONE"):
            unit = _UFF_UNITS.get(int(one.get("ordinate_spec_data_type") or 0), "")
        clock = float(one.get("abscissa_min") or 0.0), float(one.get("abscissa_inc") or 0.0)
        if not one.get("abscissa_spacing"):
            uneven[np.asarray(one["x"]).tobytes()] = np.asarray(one["x"])
        for column, values, *_ in _columns(name, one["data"]):
            yield column, values, unit, clock if clock[1] > 0.0 else None
    for number, times in enumerate(uneven.values(), 1):
        yield "time" if len(uneven) == 1 else f"abscissa {number}", times, "s"


def _lvm(file: Path) -> Iterator[_Channel]:
    found = _package("lvm_read").read(str(file), read_from_pickle=False, dump_file=False)
    blocks = [found[n] for n in range(found["Segments"])]
    same = [one for one in blocks if one["Channel names"] == blocks[0]["Channel names"]]
    if len(same) != len(blocks):
        raise ValueError("its blocks have other channels: write each block to a file of its own")
    first = blocks[0]
    names = [name.strip() for name in first["Channel names"]]
    data = np.concatenate([one["data"][:, : len(names)] for one in blocks])
    has_time = found.get("X_Columns", "One") != "No" and names[0] == "X_Value"
    ends = [(one.get("X0", [0.0])[0], one.get("Delta_X", [np.nan])[0], len(one["data"])) for one in blocks]
    units = first.get("Y_Unit_Label", [])
    for number, name in enumerate(names):
        if name == "Comment":
            continue
        if number == 0 and has_time:
            if found.get("X_Columns") == "Multi":
                raise ValueError("it has a column of times for each channel: write it with one or none")
            if np.isfinite(data[:, 0]).all():
                yield "time", data[:, 0], "s"
                continue
        position = number - has_time
        unit = units[position].strip() if position < len(units) else ""
        start, step, _ = ends[0]
        clock = (float(start), float(step)) if not has_time and np.isfinite(step) and step > 0 else None
        if clock and any(abs(x - (a + d * n)) > 0.5 * d for (a, d, n), (x, *_) in itertools.pairwise(ends)):
            raise ValueError("there are gaps between its blocks: write each block to a file of its own")
        yield name, data[:, number], unit, clock


_READERS: dict[str, Callable[[Path], Iterator[_Channel]] | None] = {
    ".csv": None,
    ".txt": None,
    ".dat": None,
    ".mat": _mat,
    ".h5": _hdf5,
    ".hdf5": _hdf5,
    ".hdf": _hdf5,
    ".tdms": _tdms,
    ".uff": _uff,
    ".unv": _uff,
    ".uf": _uff,
    ".lvm": _lvm,
}
