"""Recordings as other programs write them, each made by a few lines, and what happens to them.

`python python/tests/samples.py` writes validation/recordings.csv. With a number of seconds it reads damaged copies of
the samples for that time instead: every one must be read, or refused by a `ValueError` that names the file.
"""

import csv
import logging
import random
import sys
import tempfile
import time as clocks
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
):
    """Write UFF58; `ordinate` 8: displacement, 12: acceleration, 13: excitation force."""

    def write(file: Path) -> None:
        times = TIME + (2e-4 * np.sin(7.0 * TIME) if uneven else 0.0)
        both = {"type": 58, "func_type": kind, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "binary": 0}
        both |= {
            "abscissa_spacing": int(not uneven),
            "abscissa_spec_data_type": 17,
            "ordinate_spec_data_type": ordinate,
        }
        both |= {"orddenom_spec_data_type": 0, "ref_ent_name": "NONE", "x": times, "rsp_ent_name": "NONE"}
        both |= {"abscissa_inc": STEP, "abscissa_min": 0.0}
        data = (3.0 * np.sin(55.0 * times - np.pi / 2), 20.0 * np.sin(55.0 * times))
        for node, (name, values, unit) in enumerate(zip(names, data, units, strict=True), 1):
            more = {"data": values, "id1": name, "rsp_node": node, "ordinate_axis_units_lab": unit}
            pyuff.UFF(str(file)).write_sets(both | more, "add")

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
    Sample("CSV: constant time", "a broken logger", text(PLAIN, columns=NUMBERED * [0, 1, 1]), refusal="must rise"),
    Sample(
        "CSV: volts without a sensitivity",
        "data loggers",
        text("time,y [V],x [um]\n"),
        ("y", "x"),
        refusal="the unit V is a voltage",
    ),
    Sample("CSV: volts with a sensitivity", "data loggers", text("time,y [V],x [um]\n"), ("y:1V/mm", "x")),
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


def damaged(seconds: float, seed: int = 1) -> int:
    """Read damaged samples, and return their number."""
    draw, end, count = random.Random(seed), clocks.monotonic() + seconds, 0
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
        while clocks.monotonic() < end:
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
            count += 1
    return count


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
        print(f"{damaged(float(sys.argv[1]), seed)} damaged files: read, or refused")
    else:
        target = Path(__file__).parents[2] / "validation" / "recordings.csv"
        with target.open("w", newline="", encoding="utf-8") as rows_file:
            csv.writer(rows_file, lineterminator="\n").writerows([["kind", "tools", "result"], *table()])
