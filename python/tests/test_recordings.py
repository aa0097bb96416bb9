"""Recordings in files of other programs, and their fit."""

import subprocess
import sys

import h5py
import nptdms
import numpy as np
import pytest
import pyuff
import scipy.io

import vines


@pytest.fixture(scope="module")
def channels():
    """Time, response in mm and base in um: the exact motion of the plant, held at four drives near phase resonance."""
    scene = vines.Scene()
    step = 2 * np.pi / scene.dimensionless["omega0"] / 64
    phase, time, response, drive = 0.0, [], [], []
    for g in (1.4, 1.3, 1.2, 1.1):
        orbit = next(one for one in vines.orbits(vines.Scene(excitation={"G": g})) if one.stable)
        given = scene.drive(sigma=orbit.sigma, G=g)
        lag = phase
        for n in range(40 * 64):
            turn = given["omega"] * n * step
            time.append(len(time) * step)
            drive.append(given["amplitude"] * np.sin(lag + turn))
            response.append(
                scene.dimensionless["b"] * orbit.C * np.sin(lag + turn + orbit.gamma) + harmonic(lag + turn)
            )
        phase = lag + given["omega"] * 40 * 64 * step
    noise = np.random.default_rng(5).normal(size=(2, len(time)))
    response, drive = np.array(response), np.array(drive)
    return np.array(time), 1e3 * response + 2e-3 * noise[0], 1e6 * drive + 0.05 * noise[1]


def harmonic(phase):
    """Third harmonic of a symmetric motion, m."""
    return 4e-5 * np.sin(3 * phase + 0.4)


def write(file, time, response, drive):
    step = time[1] - time[0]
    match file.suffix:
        case ".csv":
            table = np.column_stack([time, response, drive])
            np.savetxt(file, table, delimiter=",", header="time,y,x", comments="", fmt="%.17g")
        case ".mat" if file.stem == "version73":
            # HDF5 behind a block of 512 bytes.
            with h5py.File(file, "w", userblock_size=512) as content:
                content["t"], content["y"], content["x"] = time, response, drive
            with file.open("r+b") as content:
                content.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
        case ".mat":
            scipy.io.savemat(file, {"t": time, "y": response, "x": drive.reshape(-1, 1)})
        case ".h5":
            with h5py.File(file, "w") as content:
                content["time"], content["y"], content["x"] = time, response, drive
        case ".tdms":
            properties = {"wf_increment": step, "wf_start_offset": 0.0, "wf_samples": len(time)}
            with nptdms.TdmsWriter(file) as writer:
                named = [("y", response), ("x", drive)]
                writer.write_segment([nptdms.ChannelObject("rig", *one, properties=properties) for one in named])
        case ".uff":
            both = {"type": 58, "func_type": 1, "rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "binary": 0}
            both |= {"abscissa_spacing": 1, "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 8}
            both |= {"orddenom_spec_data_type": 0, "ref_ent_name": "NONE", "x": time}
            for name, data in (("y", response), ("x", drive)):
                pyuff.UFF(str(file)).write_sets(both | {"data": data, "id1": name, "rsp_ent_name": name}, "add")


FORMATS = ("record.csv", "record.mat", "version73.mat", "record.h5", "record.tdms", "record.uff")


def test_every_format_gives_the_same_fit(channels, tmp_path):
    rate = 1 / (channels[0][1] - channels[0][0])
    # Begins and ends in the middle of a held level.
    cut = [channel[300:-400] for channel in channels]
    found = {}
    for name in FORMATS:
        write(tmp_path / name, *cut)
        read = vines.read_recording(tmp_path / name, "y:mm", "x:um", rate=rate)
        fit = vines.fit_recordings(read)
        found[name] = (read.response, read.drive, fit.parameters["value"], fit.parameters["uncertainty"])
    first = found.pop("record.csv")
    # UFF58 has twelve digits; the others have all bits.
    rounded = found.pop("record.uff")
    for name, arrays in found.items():
        assert all(np.array_equal(*pair) for pair in zip(arrays, first, strict=True)), name
    assert np.allclose(rounded[0], first[0], rtol=1e-9, atol=1e-12)
    assert np.allclose(rounded[1], first[1], rtol=1e-9, atol=1e-15)
    apart = (rounded[2] - first[2]) / first[3]
    assert np.all(np.abs(apart) < 1e-3), apart


def test_the_command_names_what_is_missing(channels, tmp_path):
    file = tmp_path / "record.mat"
    write(file, *channels)
    command = [sys.executable, "-m", "vines", "fit", file, "--response", "y:mm", "--drive", "x:um"]
    done = subprocess.run([*command, "--time", "clock"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "no channel clock" in done.stderr


def test_what_is_missing_is_named(channels, tmp_path):
    file = tmp_path / "record.csv"
    write(file, *channels)
    for words, arguments in (
        ("no channel z; it has time, y, x", ("z", "x")),
        ("the unit furlong is unknown", ("y:furlong", "x")),
    ):
        with pytest.raises(ValueError, match=words):
            vines.read_recording(file, *arguments)
    time = channels[0].copy()
    time[100:] += 1.0
    write(file, time, *channels[1:])
    with pytest.raises(ValueError, match="interrupted there"):
        vines.read_recording(file, "y:mm", "x:um")
