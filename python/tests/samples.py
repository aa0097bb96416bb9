"""Recordings as other programs write them, each made by a few lines, and what happens to them.

Without arguments this writes validation/recordings.csv. With COUNT and SEED it reads COUNT damaged copies of the
samples instead: every one must be read, or refused by a `ValueError` that names the file.
"""

import csv
import logging
import random
import re
import sys
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import nptdms
import numpy as np
import pyuff
import scipy.io

import vines

STEP = 1e-3
COUNT = 6000
TIME = STEP * np.arange(COUNT)
# A response of 3 mm that lags a base of 20 um by a quarter of a period.
RESPONSE = 3.0 * np.sin(55.0 * TIME - np.pi / 2)
DRIVE = 20.0 * np.sin(55.0 * TIME)


# For the beginning of a kind: the file, and the two channels.
FORMATS = {
    "CSV": ("a.csv", "y:mm", "x:um"),
    "text": ("a.dat", "y:mm", "x:um"),
    "MAT": ("a.mat", "y:mm", "x:um"),
    "HDF5": ("a.h5", "y:mm", "x:um"),
    "TDMS": ("a.tdms", "y", "x"),
    "UFF58": ("a.uff", "1+X", "2+X"),
    "LVM": ("a.lvm", "y", "x"),
}


@dataclass
class Sample:
    """A file, the arguments of `read_recording`, and words of the refusal; without words it is read."""

    kind: str
    tools: str
    write: Callable[[Path], Any]
    channels: tuple[str, str] | None = None
    options: dict[str, Any] = field(default_factory=dict)
    refusal: str = ""
    note: str = ""
    missing: int = 0

    def __post_init__(self) -> None:
        self.name, *channels = FORMATS[self.kind.replace(":", "").split()[0]]
        self.response, self.drive = self.channels or channels


def text(
    header: str, delimiter: str = ",", decimal: str = ".", encoding: str = "utf-8", columns: Any = None, end: str = ""
):
    """Write a table as text."""

    def write(file: Path) -> None:
        rows = np.column_stack([TIME, RESPONSE, DRIVE]) if columns is None else columns
        lines = [delimiter.join(f"{value:.12g}".replace(".", decimal) for value in row) for row in rows]
        file.write_bytes((header + "\n".join(lines) + "\n" + end).encode(encoding))

    return write


def dated(file: Path) -> None:
    """Write dates as times, with microseconds."""
    times = np.datetime64("2024-03-01T23:59:58") + (TIME * 1e6).astype("timedelta64[us]")
    rows = (f"{at},{y},{x}" for at, y, x in zip(times, RESPONSE, DRIVE, strict=True))
    file.write_text("Timestamp,y,x\n" + "\n".join(rows))


def cells(header: str, row: Callable[[float, float, float], str], encoding: str = "utf-8"):
    """Write a table whose rows are formatted by hand."""

    def write(file: Path) -> None:
        rows = (row(*one) for one in zip(TIME, RESPONSE, DRIVE, strict=True))
        file.write_text(header + "\n" + "\n".join(rows) + "\n", encoding=encoding)

    return write


def quoted(time: float, y: float, x: float) -> str:
    return ",".join(f'"{value:.9f}"'.replace(".", ",") for value in (time, y, x))


def fortran(time: float, y: float, x: float) -> str:
    return ",".join(f"{value:.9E}".replace("E", "D") for value in (time, y, x))


def without_letter(time: float, y: float, x: float) -> str:
    # The third digit of an exponent takes the place of its letter.
    return re.sub(r"E-(\d{3})", r"-\1", f"{time:.9E},{y:.9E},{1e-120 * x:.9E}")


def grouped(mark: str, decimal: str = ".", delimiter: str = ","):
    """Write micrometres and picometres with marks between thousands."""

    def number(value: float) -> str:
        text = f"{value:,.6f}".replace(",", "T").replace(".", decimal).replace("T", mark)
        return f'"{text}"' if delimiter in text else text

    return lambda time, y, x: delimiter.join(number(value) for value in (time, 1e3 * y, 1e6 * x))


def ambiguous(time: float, _y: float, _x: float) -> str:
    return f"{round(1e3 * time)};{1 + round(1e3 * time) % 9},125;2,250"


def stamped(time: float, y: float, x: float) -> str:
    return f"10:00:{int(time):02};{y:.9f};{x:.9f}".replace(".", ",")


def mat(**variables: Any):
    """Write MAT 5."""
    return lambda file: scipy.io.savemat(file, variables)


def mat73(file: Path) -> None:
    """Write MAT 7.3, HDF5 behind a block of 512 bytes, with a structure."""
    with h5py.File(file, "w", userblock_size=512) as content:
        content["HIdata/t"], content["HIdata/y"], content["HIdata/x"] = ([one] for one in (TIME, RESPONSE, DRIVE))
        content["HIdata"].attrs["MATLAB_class"] = np.bytes_("struct")
        for name in "tyx":
            content[f"HIdata/{name}"].attrs["MATLAB_class"] = np.bytes_("double")
    with file.open("r+b") as content:
        content.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def simulink() -> dict[str, Any]:
    """Return a "structure with time"."""
    signals = np.zeros(2, dtype=[("values", "O"), ("label", "O")])
    signals[0], signals[1] = (RESPONSE.reshape(-1, 1), "y"), (DRIVE.reshape(-1, 1), "x")
    return {"time": TIME.reshape(-1, 1), "signals": signals}


def hdf5(fill: Callable[[Any], None]):
    """Write HDF5."""

    def write(file: Path) -> None:
        with h5py.File(file, "w") as content:
            fill(content)

    return write


def plain(content: Any) -> None:
    content["time"], content["y"], content["x"] = TIME, RESPONSE, DRIVE


def counts(content: Any) -> None:
    content["time"] = TIME
    for name, values, unit in (("y", RESPONSE, "mm"), ("x", DRIVE, "um")):
        content[name] = np.round(values * 1e6).astype(np.int32)
        content[name].attrs["scale_factor"], content[name].attrs["units"] = 1e-6, unit


def linked(content: Any) -> None:
    plain(content.create_group("raw"))
    content["time"], content["run/y"] = h5py.SoftLink("/raw/time"), h5py.SoftLink("/raw/y")
    content["lost"], content["self"] = h5py.SoftLink("/nowhere"), h5py.SoftLink("/raw")


def angle(content: Any) -> None:
    plain(content)
    content["y"].attrs["units"] = "deg"


def filled(content: Any) -> None:
    """Counts with missing values and a scale, and times as netCDF has them."""
    content["time"] = (TIME * 1e6).round().astype(np.int64) + 5
    content["time"].attrs["units"] = "microseconds since 2024-03-01"
    for name, values, unit in (("y", RESPONSE, "mm"), ("x", DRIVE, "um")):
        packed = np.round((values - 1.0) * 1e6).astype(np.int32)
        packed[4000:4010] = -9999 if name == "y" else packed[4000:4010]
        content[name] = packed
        attributes = {
            "_FillValue": np.array([-9999], np.int32),
            "scale_factor": 1e-6,
            "add_offset": [1.0],
            "units": unit,
        }
        content[name].attrs.update(attributes)


def out_of_range(content: Any) -> None:
    plain(content)
    content["y"][100] = 1e20
    content["y"].attrs["valid_max"] = 10.0


def compound(content: Any) -> None:
    content["log"] = np.array(
        list(zip(TIME, RESPONSE, DRIVE, strict=True)), dtype=[("t", "f8"), ("y", "f8"), ("x", "f8")]
    )


def matrix(content: Any) -> None:
    content["data"] = np.column_stack([TIME, RESPONSE, DRIVE])


def spectra(content: Any) -> None:
    plain(content)
    content["frf"] = np.fft.fft(RESPONSE)


def tdms(shift: int = 0, rate: int = 1, stamped: bool = False, cut: int = 0, unit: str = "mm"):
    """Write TDMS: the base begins `shift` samples later, at `rate` times the rate; `cut` bytes are missing."""

    def write(file: Path) -> None:
        start = np.datetime64("2024-03-01T12:00:00.000000")
        times = TIME if rate == 1 else (STEP / rate) * np.arange(rate * COUNT)
        drive = 20.0 * np.sin(55.0 * times)
        if stamped:
            stamps = start + (TIME * 1e6).astype("timedelta64[us]")
            channels = [("Time", stamps, {}), ("y", RESPONSE, {}), ("x", DRIVE, {})]
        else:
            base = {"wf_start_offset": 0.0, "wf_samples": 1}
            late = start + np.timedelta64(round(1e6 * shift * STEP), "us")
            channels = [
                ("y", RESPONSE, base | {"wf_increment": STEP, "wf_start_time": start, "unit_string": unit}),
                (
                    "x",
                    drive[shift * rate :],
                    base | {"wf_increment": STEP / rate, "wf_start_time": late, "unit_string": "um"},
                ),
            ]
        with nptdms.TdmsWriter(file) as writer:
            for part in range(4):
                parts = [(name, np.array_split(values, 4)[part], more) for name, values, more in channels]
                writer.write_segment(
                    [nptdms.ChannelObject("rig", name, values, properties=more) for name, values, more in parts]
                )
        if cut:
            file.write_bytes(file.read_bytes()[:-cut])

    return write


def uff(
    names: tuple[str, str] = ("NONE", "NONE"),
    kind: int = 1,
    uneven: bool = False,
    units: tuple[str, str] = ("mm", "um"),
    ordinate: int = 8,
    per_metre: float = 0.0,
    time: str = "s",
    end: str = "",
):
    """Write UFF58; `ordinate` 8: displacement, 12: acceleration, 13: excitation force. `per_metre`: of data set 164."""

    def write(file: Path) -> None:
        times = TIME + (2e-4 * np.sin(7.0 * TIME) if uneven else 0.0)
        both = {"type": 58, "func_type": kind, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "binary": 0}
        both |= {
            "abscissa_spacing": int(not uneven),
            "abscissa_spec_data_type": 17,
            "ordinate_spec_data_type": ordinate,
        }
        abscissa = 1e3 * times if time == "ms" else times
        both |= {"orddenom_spec_data_type": 0, "ref_ent_name": "NONE", "x": abscissa, "rsp_ent_name": "NONE"}
        both |= {"abscissa_inc": STEP * (1e3 if time == "ms" else 1.0), "abscissa_min": 0.0}
        both |= {"abscissa_axis_units_lab": time}
        if per_metre:
            about = {
                "units_code": 5,
                "units_description": "mm",
                "temp_mode": 1,
                "length": per_metre,
                "force": per_metre,
            }
            pyuff.UFF(str(file)).write_sets(about | {"type": 164, "temp": 1.0, "temp_offset": 273.15}, "add")
        data = (3.0 * np.sin(55.0 * times - np.pi / 2), 20.0 * np.sin(55.0 * times))
        for node, (name, values, unit) in enumerate(zip(names, data, units, strict=True), 1):
            more = {"data": values, "id1": name, "rsp_node": node, "ordinate_axis_units_lab": unit}
            pyuff.UFF(str(file)).write_sets(both | more, "add")
        if end:
            blocks = file.read_text().split("    -1\n")
            damaged = blocks[1].rstrip("\n") + end if end != "cut" else "".join(blocks[1].splitlines(True)[:-9])
            file.write_text("    -1\n".join([blocks[0], damaged.rstrip("\n") + "\n", *blocks[2:]]))

    return write


def lvm(
    separator: str = "\t", decimal: str = ".", columns: str = "No", blocks: int = 1, gap: float = 0.0, unit: str = "mm"
):
    """Write a measurement file of LabVIEW."""

    def write(file: Path) -> None:
        name = "Comma" if separator == "," else "Tab"
        head = [
            "LabVIEW Measurement",
            f"Writer_Version{separator}2",
            f"Separator{separator}{name}" if separator == "\t" else "Separator,Comma",
        ]
        head += [f"Decimal_Separator{separator}{decimal}", f"Multi_Headings{separator}{'Yes' if blocks > 1 else 'No'}"]
        head += [f"X_Columns{separator}{columns}", "***End_of_Header***" + separator, ""]
        lines, size = [separator.join([one]) for one in head], COUNT // blocks

        def number(value: float) -> str:
            return f"{value:.9f}".replace(".", decimal)

        for block in range(blocks):
            first = block * size
            start = TIME[first] + block * gap
            lines += [separator.join(["Channels", "2", "", ""]), separator.join(["Samples", str(size), str(size), ""])]
            lines += [
                separator.join(["Y_Unit_Label", unit, "um", ""]),
                separator.join(["X0", number(start), number(start), ""]),
            ]
            lines += [
                separator.join(["Delta_X", number(STEP), number(STEP), ""]),
                "***End_of_Header***" + separator * 3,
            ]
            lines.append(separator.join(["X_Value", "y", "x", "Comment"]))
            for n in range(first, first + size):
                at = "" if columns == "No" else number(TIME[n] + block * gap)
                row = [at, number(RESPONSE[n]), number(DRIVE[n])]
                lines.append(separator.join(row + (["begin"] if n == first else [])))
            lines.append("")
        file.write_text("\n".join(lines[:-1]) + "\n")

    return write


NUMBERED = np.column_stack([TIME, RESPONSE, DRIVE])
PLAIN = "time,y,x\n"
SAMPLES = [
    Sample("CSV: comma, point", "NumPy, pandas, Python", text(PLAIN)),
    Sample(
        "CSV: semicolon, decimal comma, row of units, Latin-1",
        "Excel (German), DIAdem",
        text("time;y;x\ns;mm;µm\n", ";", ",", "latin-1"),
        ("y", "x"),
    ),
    Sample("CSV: tab, UTF-16", "Excel (Unicode text)", text("time\ty\tx\n", "\t", ".", "utf-16")),
    Sample(
        "CSV: preamble, units in brackets",
        "HBM catman, oscilloscopes",
        text("Rig,3\nRate,1000\n\ntime [s],y (mm),x [um]\n"),
        ("y", "x"),
        {"time": "time [s]"},
    ),
    Sample("text: spaces, commented header", "numpy.savetxt", text("# time y x\n", " ")),
    Sample("CSV: without names", "loggers", text(""), ("2:mm", "3:um"), {"time": "1"}),
    Sample("CSV: last row cut off", "a logger that was switched off", text(PLAIN, end="6.0,1.")),
    Sample("CSV: a name twice", "Excel", text("time,y,y\n"), ("y:mm", "y:um"), refusal="numbers 2 and 3"),
    Sample("CSV: dates", "loggers, pandas", dated),
    Sample("CSV: milliseconds", "Arduino, oscilloscopes", text("t (ms),y,x\n", columns=NUMBERED * [1e3, 1, 1])),
    Sample(
        "CSV: time of six digits at 100 s",
        "LabVIEW, Excel",
        text(PLAIN, columns=np.column_stack([np.round(100.0004 + 1.1338 * TIME, 3), RESPONSE, DRIVE])),
        options={"rate": 1000.0},
        note="rounded",
    ),
    Sample(
        "CSV: samples missing",
        "a logger that lost some",
        text(PLAIN, columns=np.delete(NUMBERED, slice(3000, 3100), axis=0)),
        options={"rate": 1000.0},
        refusal="interrupted there",
    ),
    Sample(
        "CSV: time goes back",
        "two runs in a file",
        text(PLAIN, columns=np.vstack([NUMBERED, NUMBERED])),
        refusal="interrupted there",
    ),
    Sample(
        "CSV: constant time",
        "a broken logger",
        text(PLAIN, columns=NUMBERED * [0, 1, 1]),
        refusal="give the samples a second",
    ),
    Sample(
        "CSV: volts without a sensitivity",
        "data loggers",
        text("time,y [V],x [um]\n"),
        ("y", "x"),
        refusal="the unit V is a voltage",
    ),
    Sample("CSV: volts with a sensitivity", "data loggers", text("time,y [V],x [um]\n"), ("y:1V/mm", "x")),
    Sample("CSV: quoted decimal commas", "Excel, databases", cells('"t","y [mm]","x [um]"', quoted), ("y", "x")),
    Sample("CSV: exponents with D", "Fortran", cells("t,y [mm],x [um]", fortran), ("y", "x")),
    Sample("CSV: exponents without a letter", "Fortran", cells("t,y [mm],x", without_letter), ("y", "x:1e114")),
    Sample("CSV: commas between thousands", "Excel", cells("t,y [um],x [nm]", grouped(",")), ("y", "x:0.001nm")),
    Sample(
        "CSV: points between thousands",
        "Excel (German)",
        cells("t;y [um];x [nm]", grouped(".", ",", ";")),
        ("y", "x:0.001nm"),
    ),
    Sample(
        "CSV: narrow spaces between thousands",
        "Excel (French)",
        cells("t;y [um];x [nm]", grouped("\u202f", ",", ";")),
        ("y", "x:0.001nm"),
    ),
    Sample(
        "CSV: thousands or decimals",
        "Excel",
        cells("t;y;x", ambiguous),
        refusal="may be",
    ),
    Sample(
        "CSV: durations",
        "MATLAB (writetimetable)",
        cells("Time,y [mm],x [um]", lambda time, y, x: f"{time:.6f} sec,{y:.9f},{x:.9f}"),
        ("y", "x"),
    ),
    Sample(
        "CSV: units in the cells that change",
        "data loggers",
        cells("Time,y,x", lambda t, y, x: (f"{1e3 * t:.3f} ms" if t < 1 else f"{t:.6f} s") + f",{y:.9f} mm,{x:.9f} um"),
        ("y", "x"),
    ),
    Sample(
        "CSV: hours, minutes and seconds with a comma",
        "DIAdem",
        cells("Time;y;x", lambda t, y, x: f"00:00:{t:09.6f};{y:.9f};{x:.9f}".replace(".", ",")),
    ),
    Sample(
        "CSV: time stamps of one second", "loggers", cells("Time;y;x", stamped), refusal="give the samples a second"
    ),
    Sample(
        "CSV: time stamps of one second, and a rate",
        "loggers",
        cells("Time;y;x", stamped),
        options={"rate": 1000.0},
        note="steps of 1.000000 s",
    ),
    Sample(
        "CSV: names that are numbers above units in words",
        "Keysight oscilloscopes",
        text("x-axis,1,2\nsecond,Volt,Volt\n"),
        ("1:1V/mm", "2:1V/um"),
    ),
    Sample(
        "CSV: first row damaged",
        "loggers",
        text("t,y [mm],x [um]\n0.0,0.1,0.2,extra\n"),
        ("y", "x"),
        refusal="row 2: it has 4 values, 0.0, 0.1, 0.2, extra",
    ),
    Sample("CSV: first row with a word", "loggers", text("t,y,x\n0.0,??,0.2\n"), refusal="row 2: it has 3 values"),
    Sample("CSV: time by its unit", "German programs", text("Zeit [s],y,x\n")),
    Sample("CSV: rate of 0", "", text(PLAIN), options={"rate": 0.0}, refusal="must be above 0"),
    Sample("CSV: empty file", "a full disk", lambda file: file.touch(), refusal="is empty"),
    Sample("MAT 5: vectors", "MATLAB, SciPy", mat(t=TIME, y=RESPONSE, x=DRIVE.reshape(-1, 1))),
    Sample(
        "MAT 5: structure",
        "MATLAB",
        mat(HIdata={"t": TIME, "y": RESPONSE, "x": DRIVE}),
        ("HIdata.y:mm", "HIdata.x:um"),
        {"time": "HIdata.t"},
    ),
    Sample("MAT 5: structure with time", "Simulink", mat(out=simulink()), options={"time": "out.time"}),
    Sample("MAT 5: matrix of columns", "MATLAB", mat(data=NUMBERED), ("data/2:mm", "data/3:um"), {"time": "data/1"}),
    Sample("MAT 7.3: structure", "MATLAB", mat73, ("HIdata.y:mm", "HIdata.x:um"), {"time": "HIdata.t"}),
    Sample("HDF5: datasets", "h5py", hdf5(plain), ("/y:mm", "x:um")),
    Sample("HDF5: counts with scale_factor and units", "netCDF, xarray", hdf5(counts), ("y", "x")),
    Sample(
        "HDF5: soft links, also broken and in a circle",
        "h5py, NeXus",
        hdf5(linked),
        ("run/y:mm", "raw/x:um"),
        {"time": "raw/time"},
    ),
    Sample("HDF5: compound table", "PyTables, pandas", hdf5(compound)),
    Sample("HDF5: columns of a matrix", "h5py", hdf5(matrix), ("data/2:mm", "data/3:um"), {"time": "data/1"}),
    Sample("HDF5: complex data", "spectra", hdf5(spectra), ("frf", "x:um"), refusal="complex"),
    Sample("HDF5: times since a date, missing values", "netCDF, xarray", hdf5(filled), ("y", "x"), missing=10),
    Sample("HDF5: values out of their valid range", "netCDF", hdf5(out_of_range), missing=1),
    Sample("HDF5: an angle", "h5py", hdf5(angle), ("y", "x:um"), refusal="deg is one of angles"),
    Sample("TDMS: an angular velocity", "LabVIEW", tdms(unit="rad/s"), refusal="one of frequencies"),
    Sample("TDMS: waveforms", "LabVIEW", tdms()),
    Sample("TDMS: one channel begins later", "LabVIEW", tdms(shift=1), note="begins"),
    Sample("TDMS: two rates", "LabVIEW", tdms(rate=2), note="common"),
    Sample("TDMS: a channel of dates", "LabVIEW, FlexLogger", tdms(stamped=True), ("y:mm", "x:um")),
    Sample("TDMS: cut off by a crash", "LabVIEW", tdms(cut=9000), note="common"),
    Sample("UFF58: id lines NONE", "LMS Test.Lab, ME'scope", uff()),
    Sample(
        "UFF58: names with a colon", "LMS Test.Lab", uff(("1x : m/s²", "2x : m/s²")), ("1x : m/s²:mm", "2x : m/s²:um")
    ),
    Sample("UFF58: uneven abscissa", "pyuff, simulations", uff(uneven=True), note="interpolated"),
    Sample(
        "UFF58: unit by data set 164",
        "sdtools, simulations",
        uff(units=("NONE", "NONE"), per_metre=1e3),
        ("1+X", "2+X:um"),
    ),
    Sample("UFF58: label against data set 164", "LMS Test.Lab", uff(per_metre=1.0), refusal="mm by its label"),
    Sample("UFF58: label against data set 164, and a unit", "LMS Test.Lab", uff(per_metre=1.0), ("1+X:mm", "2+X:um")),
    Sample("UFF58: abscissa in ms", "simulations", uff(time="ms")),
    Sample("UFF58: abscissa in revolutions", "order analysis", uff(time="rev"), refusal="abscissa is in rev"),
    Sample("UFF58: last line filled with zeros", "older programs", uff(end="\n" + "  0.000000000000E+00" * 4)),
    Sample("UFF58: cut off", "a full disk", uff(end="cut"), refusal="the file is cut off"),
    Sample("UFF58: frequency response function", "LMS Test.Lab", uff(kind=4), refusal="frequency response function"),
    Sample("UFF58: power spectral density", "LMS Test.Lab", uff(kind=9), refusal="power spectral density"),
    Sample("UFF58: a force cell", "LMS Test.Lab", uff(units=("mm", "N")), refusal="N is a force"),
    Sample("UFF58: a force without a unit", "pyuff", uff(units=("NONE", "NONE"), ordinate=13), refusal="N is a force"),
    Sample("LVM: volts", "LabVIEW", lvm(unit="V"), refusal="V is a voltage"),
    Sample("LVM: tab, without times", "LabVIEW", lvm()),
    Sample("LVM: decimal comma, one column of times", "LabVIEW (German)", lvm(decimal=",", columns="One")),
    Sample("LVM: comma as separator, comments", "LabVIEW", lvm(separator=",", columns="One")),
    Sample("LVM: several blocks", "LabVIEW", lvm(blocks=3)),
    Sample("LVM: several blocks with gaps", "LabVIEW", lvm(blocks=3, gap=0.5), refusal="gaps between its blocks"),
]


def read(sample: Sample, file: Path) -> vines.Recording:
    """Read a sample as its user would."""
    return vines.read_recording(file, sample.response, sample.drive, **sample.options)


def damaged(count: int, seed: int = 1) -> None:
    """Read so many damaged samples."""
    draw = random.Random(seed)
    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as folder:
        originals = []
        # SciPy 1.17 itself ends the process (SIGSEGV in scipy.io.matlab) on some damaged files.
        fuzzed = [sample for sample in SAMPLES if not sample.name.endswith(".mat")]
        for sample in fuzzed:
            file = Path(folder) / sample.name
            file.unlink(missing_ok=True)
            sample.write(file)
            originals.append(file.read_bytes())
        for _ in range(count):
            n = draw.randrange(len(fuzzed))
            content, file = (
                bytearray(originals[n][:20000] if draw.random() < 0.5 else originals[n]),
                Path(folder) / fuzzed[n].name,
            )
            for _ in range(draw.choice((1, 3, 30))):
                if content:
                    at = draw.randrange(min(len(content), draw.choice((300, len(content)))))
                    match draw.randrange(3):
                        case 0:
                            content[at] = draw.randrange(256)
                        case 1:
                            del content[at : at + draw.randrange(1, 200)]
                        case 2:
                            content[at:at] = content[at : at + 20]
            file.write_bytes(content)
            try:
                read(fuzzed[n], file)
            except ValueError as error:
                if file.name not in str(error):
                    raise


def table() -> list[list[str]]:
    """Return what happens to each sample."""
    rows = []
    for sample in SAMPLES:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / sample.name
            sample.write(file)
            try:
                notes = read(sample, file).notes
                result = "read" + (
                    f": {sample.note}" if sample.note and any(sample.note in one for one in notes) else ""
                )
            except ValueError as error:
                result = "refused: " + str(error).splitlines()[0].replace(f"{folder}/", "")
        rows.append([sample.kind, sample.tools, result])
    return rows


if __name__ == "__main__":
    if len(sys.argv) > 1:
        seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
        damaged(int(sys.argv[1]), seed)
        print(f"{sys.argv[1]} damaged files: read, or refused")
    else:
        target = Path(__file__).parents[2] / "validation" / "recordings.csv"
        with target.open("w", newline="", encoding="utf-8") as rows_file:
            csv.writer(rows_file, lineterminator="\n").writerows([["kind", "tools", "result"], *table()])
