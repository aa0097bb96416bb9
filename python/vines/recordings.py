"""Recordings of two channels over time: tables as text, MAT, HDF5, TDMS, UFF58 and LVM."""

import csv
import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native, texts
from .numbers import factor, real, reals, symbol
from .packages import package
from .scenes import Scene, checked

# SI units of what an ordinate of UFF58 is, and the factor of its data set 164, for files without labels.
_UFF_UNITS = {8: ("m", "length"), 9: ("N", "force"), 11: ("m/s", "length"), 12: ("m/s²", "length"), 13: ("N", "force")}
_UFF_TYPES = {
    2: "an auto spectrum",
    3: "a cross spectrum",
    4: "a frequency response function",
    9: "a power spectral density",
}


@dataclass(frozen=True)
class Recording:
    """Two channels of a measurement, sampled at equal distances.

    Response and base that carry a unit are converted to SI units. Masked and absent samples are NaN, which a fit
    refuses with the number of the sample.

    Attributes
    ----------
    origin : str
        Where it comes from, for messages: the name of a file.
    channels : tuple of str
        Names of the channels of response and base, for messages; the second is empty if the base rests.
    sample_time : float
        Time from sample to sample, s.
    response, drive : ndarray
        Response and base, m, m/s or m/s²; a force in N.
    start : float
        Time of the first sample, s.
    measured : tuple of str
        What response and base are: "displacement", "velocity" or "acceleration"; the drive may be a "force".
    notes : tuple of str
        What is to be known of the way it was read: the clock, and what was cut or interpolated.
    own : bool
        Whether a run of vines wrote it, whose scene says what the sensor of the response reads.

    Raises
    ------
    ValueError
        A unit of another quantity, or what is no number.
    """

    origin: str
    channels: tuple[str, str]
    sample_time: float
    response: NDArray[np.float64]
    drive: NDArray[np.float64]
    start: float = 0.0
    measured: tuple[str, str] = ("displacement", "displacement")
    notes: tuple[str, ...] = ()
    own: bool = False

    def __post_init__(self) -> None:
        kinds = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s²", "force": "N"}
        for name, kind in zip(("response", "drive"), self.measured, strict=True):
            values = reals(name, getattr(self, name), kinds.get(kind, "1"), missing=True)
            object.__setattr__(self, name, values.ravel())
        for name in ("sample_time", "start"):
            object.__setattr__(self, name, real(getattr(self, name), "s", name))

    def _tuple(self) -> tuple[Any, ...]:
        clock = [self.start, self.sample_time]
        values = self.response, self.drive
        return self.origin, list(self.channels), clock, list(self.measured), *values, self.own, list(self.notes)


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
        A file .mat (5 and 7.3), .h5, .hdf5, .nc, .tdms, .uff, .unv or .lvm; any other is a table as text, such as .csv.
        All but tables of numbers as text need `vines-testbench[io]`.
    response, drive : str, optional
        Channels of the response and of the base, by default `response` and `reference`: a name or a number, and after a
        colon a unit if the file has none (m, mm, µm, mm/s, m/s², g) or a multiple of it ("-1g"), the sensitivity of the
        sensor ("100mV/g", "125mm/s/V"), or metres per unit ("-0.5"). The last part of a path is enough where it is the
        only one. Without a channel of the base the base rests.
    rate : float, optional
        Samples a second. Without it the file says it: a channel of the time, or the clock of a channel in TDMS,
        UFF58 or LVM.
    time : str, optional
        Channel of the time, by default `time` or `t`, or the only one in a unit of time.
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
    contents = contents_of(path)
    if isinstance(contents, bytes):
        raise ValueError(f"{path} is JSON: a recording has two channels over time")
    numbers = (
        None if one is None else real(one, unit, name)
        for one, unit, name in ((rate, "Hz", "rate"), (late, "s", "late"))
    )
    origin, names, (start, step), measured, y, x, own, notes = _native.recording(
        str(path), contents, [response, drive, time], *numbers
    )
    pair = (measured[0], measured[1])
    return Recording(origin, (names[0], names[1]), step, np.array(y), np.array(x), start, pair, tuple(notes), own)


def contents_of(path: str | PathLike[str]) -> bytes | tuple[Any, ...]:
    """Return the channels of a file as the compiled part takes them; bytes of a file in JSON."""
    file = Path(path)
    suffix = file.suffix.lower()
    if not file.is_file():
        raise ValueError(f"cannot read {file}: it is no file")
    if suffix not in _READERS:
        return _text(file)
    try:
        every = list(_READERS[suffix](file))
    except ImportError:
        raise
    except Exception as error:
        raise ValueError(f"{file} cannot be read as {suffix[1:].upper()}: {error}") from error
    channels = [_tuple(*one) for one in every if not isinstance(one[1], str)]
    refused = [[name, reason] for name, reason, *_ in every if isinstance(reason, str)]
    if not every:
        raise ValueError(f"{file} has no channel of numbers")
    return "", 0, channels, refused


def _text(file: Path) -> bytes | tuple[Any, ...]:
    """Return the columns of a table: a plain one as `vines` reads it, others by their dialect."""
    content = file.read_bytes()
    text = texts.decoded(content[:100_000]).lstrip()
    if "\0" in text:
        raise ValueError(
            f"{file}: the format {file.suffix or 'without extension'} is unknown; text and {', '.join(_READERS)} are "
            "known"
        )
    if text.startswith("{"):
        return texts.decoded(content).lstrip("\ufeff").encode()
    try:
        layout, line, columns = _native.table(str(file), content)
        if not _is_plain(columns):
            raise ValueError
        named = [(name, unit, values, cells) for name, unit, (values, cells) in columns]
    except ValueError:
        try:
            layout, line, named = texts.table(str(file), content)
        except csv.Error as error:
            raise ValueError(f"{file} cannot be read as a table: {error}") from error
    return layout, line, [(name, unit, values, cells, None) for name, unit, values, cells in named], []


def _is_plain(columns: list[Any]) -> bool:
    """Return whether no column has numbers among its texts, of this dialect or another."""
    marks = [texts.Mark(mark) for mark in ".,"]
    mixed = any(cells and np.isfinite(values).any() for _, _, (values, cells) in columns)
    return not mixed and not any(
        mark.reads(cell) for _, _, (_, cells) in columns for cell in cells if cell for mark in marks
    )


# A channel of a file: name, samples or the reason why it has none, unit, and start and step of its clock.
_Channel = tuple[Any, ...]


def _tuple(name: str, values: Any, unit: str = "", clock: tuple[float, float] | None = None) -> _Channel:
    short = symbol(unit) if unit.strip() else ""
    return name, short, np.ascontiguousarray(values, dtype=np.float64), [], None if clock is None else list(clock)


def _columns(name: str, values: Any, unit: str = "") -> Iterator[_Channel]:
    """Channels of an array: itself, its fields, or its columns with numbers from 1; the longer side is the time."""
    # What is masked is missing.
    masked = isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values)
    array = np.asarray(np.ma.filled(values.astype(np.float64), np.nan) if masked else values)
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
        yield name, array.ravel(), unit
    elif array.ndim == 2:
        table = array if array.shape[0] >= array.shape[1] else array.T
        for number, column in enumerate(table.T[:1000], 1):
            yield f"{name}/{number}", column, unit
    else:
        yield name, f"it has the shape {array.shape}; a channel is one row or column of numbers"


def _mat(file: Path) -> Iterator[_Channel]:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = package("pymatreader").read_mat(file)
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
    h5py = package("h5py")
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
            yield from _columns(full, *_decoded(one))


def _decoded(dataset: Any) -> tuple[Any, str]:
    """Return values and unit of a dataset, with the attributes of netCDF that change the values (CF conventions)."""
    attributes = {key: _attribute(dataset.attrs[key]) for key in _CF if key in dataset.attrs}
    unit = next((str(attributes.pop(key)) for key in _UNITS if key in attributes), "")
    values = dataset[()]
    if not attributes and " since " not in unit:
        return values, unit
    limits = attributes.pop("valid_range", (attributes.pop("valid_min", None), attributes.pop("valid_max", None)))
    if any(one is not None for one in limits):
        low, high = (side if one is None else one for one, side in zip(limits, (-np.inf, np.inf), strict=True))
        values = np.where((values >= low) & (values <= high), values, np.nan)
        attributes |= {key: float(attributes[key]) for key in ("_FillValue", "missing_value") if key in attributes}
    xarray = package("xarray")
    dimensions = [f"d{n}" for n in range(np.ndim(values))]
    given = xarray.Dataset({"v": (dimensions, values, attributes | ({"units": unit} if unit else {}))})
    found = xarray.decode_cf(given, decode_timedelta=False)["v"]
    return found.values, str(found.attrs.get("units", ""))


#: Attributes with the unit of a dataset, and all that change its values.
_UNITS = ("units", "unit", "Units", "Unit")
_CF = (
    *_UNITS, "calendar", "scale_factor", "add_offset", "_FillValue", "missing_value", "_Unsigned",
    "valid_min", "valid_max", "valid_range",
)  # fmt: skip


def _attribute(value: Any) -> Any:
    """Return an attribute as a text, a number, or an array."""
    array = np.ravel(value)
    one = array[0] if array.size == 1 else value
    return one.decode() if isinstance(one, bytes) else one


def _tdms(file: Path) -> Iterator[_Channel]:
    channels = [channel for group in package("nptdms").TdmsFile.read(file).groups() for channel in group.channels()]
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
    sets = package("pyuff").UFF(str(file)).read_sets()
    sets = sets if isinstance(sets, list) else [sets]
    functions = [one for one in sets if one.get("type") == 58]
    stated: Mapping[str, Any] = next((one for one in sets if one.get("type") == 164), {})
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
        second = factor(_label(one, "abscissa") or "s", "s")
        if second is None:
            yield name, f"its abscissa is in {_label(one, 'abscissa')}, and a time needs s, ms, us or min"
            continue
        clock = second * float(one.get("abscissa_min") or 0.0), second * float(one.get("abscissa_inc") or 0.0)
        # Zeros fill the last line of a block.
        count = int(one.get("num_pts") or 0)
        values = np.asarray(one["data"])
        if values.size < count:
            yield name, f"it has {values.size} samples, and its header says {count}: the file is cut off"
            continue
        values = values[: count or None]
        if not one.get("abscissa_spacing"):
            times = second * np.asarray(one["x"])[: count or None]
            uneven[times.tobytes()] = times
        for column, samples, *_ in _columns(name, values):
            yield column, samples, _uff_unit(one, stated), clock if clock[1] > 0.0 else None
    for number, times in enumerate(uneven.values(), 1):
        yield "time" if len(uneven) == 1 else f"abscissa {number}", times, "s"


def _label(function: Mapping[str, Any], axis: str) -> str:
    """Return the label of the unit of an axis; empty without one."""
    text = str(function.get(f"{axis}_axis_units_lab") or "").strip()
    return "" if text.upper() == "NONE" else text


def _uff_unit(function: Mapping[str, Any], stated: Mapping[str, Any]) -> str:
    """Return the unit of a response: by its label, or by the kind of its ordinate and data set 164."""
    label, kind = _label(function, "ordinate"), int(function.get("ordinate_spec_data_type") or 0)
    unit, side = _UFF_UNITS.get(kind, ("", ""))
    per_si = float(stated.get(side) or 0.0)
    by_set = f"{1.0 / per_si:.12g}{unit}" if per_si > 0.0 and per_si != 1.0 else unit
    if not label or not per_si:
        return label or by_set
    same = factor(label, by_set)
    # What is no unit asks for one.
    return label if same is None or abs(same - 1.0) < 1e-6 else f"{label} by its label, and {by_set} by data set 164"


def _lvm(file: Path) -> Iterator[_Channel]:
    found = package("lvm_read").read(str(file), read_from_pickle=False, dump_file=False)
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


_READERS: dict[str, Callable[[Path], Iterator[_Channel]]] = {
    ".mat": _mat,
    ".h5": _hdf5,
    ".hdf5": _hdf5,
    ".hdf": _hdf5,
    ".nc": _hdf5,
    ".tdms": _tdms,
    ".uff": _uff,
    ".unv": _uff,
    ".uf": _uff,
    ".lvm": _lvm,
}
