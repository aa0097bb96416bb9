"""Recordings in files of other programs, and their fit."""

import csv
import importlib.util
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import samples
import scipy.io

import vines


@pytest.mark.parametrize("sample", samples.SAMPLES, ids=lambda sample: sample.kind)
def test_a_file_as_other_programs_write_it_is_read_or_refused_for_the_true_reason(sample, tmp_path):
    file = tmp_path / sample.name
    sample.write(file)
    if sample.refusal:
        with pytest.raises(ValueError, match=sample.refusal) as caught:
            samples.read(sample, file)
        assert file.name in str(caught.value)
        return
    read = samples.read(sample, file)
    assert read.sample_time == pytest.approx(samples.STEP, rel=1e-5)
    count = len(read.response)
    assert count == len(read.drive)
    assert count >= 0.7 * samples.COUNT
    # The base begins with the file or, where it is cut, a whole number of samples later.
    times = read.start + read.sample_time * np.arange(count)
    shift = 1 if "later" in sample.kind else 0
    times = samples.TIME[shift : shift + count] if "uneven" not in sample.kind else times
    # The uneven abscissa of UFF58 has six digits.
    share = 3e-3 if "uneven" in sample.kind else 1e-4
    missing = np.isnan(read.response)
    assert missing.sum() == sample.missing
    assert np.allclose(read.response[~missing], 3e-3 * np.sin(55.0 * times[~missing] - np.pi / 2), atol=3e-3 * share)
    if sample.missing:
        with pytest.raises(ValueError, match=r"sample \d+ .* is not a finite number"):
            vines.fit_recordings(read)
    assert np.allclose(read.drive, 2e-5 * np.sin(55.0 * times), atol=2e-5 * share)
    if sample.note:
        assert any(sample.note in note for note in read.notes), read.notes


def test_damaged_files_are_read_or_refused():
    samples.damaged(100)


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
            turn = lag + given["omega"] * n * step
            time.append(len(time) * step)
            drive.append(given["amplitude"] * np.sin(turn))
            third = 4e-5 * np.sin(3 * turn + 0.4)
            response.append(scene.dimensionless["b"] * orbit.C * np.sin(turn + orbit.gamma) + third)
        phase = lag + given["omega"] * 40 * 64 * step
    noise = np.random.default_rng(5).normal(size=(2, len(time)))
    response, drive = np.array(response), np.array(drive)
    return np.array(time), 1e3 * response + 2e-3 * noise[0], 1e6 * drive + 0.05 * noise[1]


def test_two_formats_give_the_same_fit(channels, tmp_path):
    # Begins and ends in the middle of a held level.
    time, response, drive = (channel[300:-400] for channel in channels)
    table = np.column_stack([time, response, drive])
    np.savetxt(tmp_path / "record.csv", table, delimiter=",", header="time,y,x", comments="", fmt="%.17g")
    scipy.io.savemat(tmp_path / "record.mat", {"t": time, "y": response, "x": drive})
    names = ("record.csv", "record.mat")
    scene = vines.Scene(resonance={"sensor": "v"})
    fits = [vines.fit_recordings(vines.read_recording(tmp_path / name, "y:mm", "x:um"), scene) for name in names]
    for name in ("value", "uncertainty"):
        assert np.array_equal(*(fit.parameters[name] for fit in fits))
    held = [one for one in fits[0].stretches if one["motion"] == "1:1"]
    # The levels follow each other without the motion between them, which no rig has.
    assert sum(one["seconds"][1] - one["seconds"][0] for one in held) > 0.6 * (time[-1] - time[0])
    expected = fits[0].channels["expected"][fits[0].channels["hypothesis"] == "ideal cavity"]
    # The others are those of the scene: five equations, of which five parameters take about as much.
    assert fits[0].degrees - 5 <= expected.sum() <= fits[0].degrees


def call(*words, **environment):
    """Run a command line: exit code, standard output, and standard error without lines of progress."""
    known = os.environ | environment
    done = subprocess.run([str(word) for word in words], capture_output=True, check=False, env=known)
    out, err = (text.decode(errors="replace") for text in (done.stdout, done.stderr))
    return done.returncode, out, re.sub(r".*: \d+ of \d+ .*\n", "", err)


PYTHON = [sys.executable, "-m", "vines"]


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    """The lines of tracked.csv."""
    folder = tmp_path_factory.mktemp("tracked")
    code, _, err = call(os.environ["VINES"], "backbone", "--set", "backbone.points=8", "--out", folder)
    assert code == 0, err
    return (folder / "tracked.csv").read_text().splitlines()


def test_the_command_line_is_that_of_the_program_for_every_option_and_format(tracked, tmp_path):
    names = ("f_Hz", "A_m", "E_m", "u_f_Hz", "u_A_m", "u_E_m")
    places = [tracked[0].split(",").index(name) for name in names]
    table = np.array([[float(row.split(",")[place]) for place in places] for row in tracked[1:]])
    table[:, 1] *= 1e3
    head = ",".join(names).replace(",A_m", ",response")
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=head, comments="", fmt="%.17g")
    with h5py.File(tmp_path / "b.h5", "w") as file:
        for name, column in zip(head.split(","), table.T, strict=True):
            file[name] = column
    lines = [",".join(f'"{value:.17g}"'.replace(".", ",") for value in row) for row in table]
    (tmp_path / "c.txt").write_text("\n".join([head, *lines]), encoding="utf-16")
    options = ["--column", "A=response:mm", "--set", "plant.r=0.7", "--set", "resonance.sensor=v"]
    options += ["--known", "m=0.032±0.0003"]
    found = []
    for program, name in (([os.environ["VINES"]], "a.csv"), (PYTHON, "b.h5"), (PYTHON, "c.txt")):
        file = tmp_path / name
        base = file.with_suffix("")
        files = ["--out", f"{base}.toml", "--figure", f"{base}.svg"]
        texts = [call(*program, "fit", file, *options, *more) for more in (files, ["--json"])]
        texts += [call(*program, "fit", file, *wrong) for wrong in (["--set", "plant.r=7"], ["--rote", "1"], [])]
        assert [code for code, *_ in texts] == [0, 0, 2, 2, 2]
        report = json.loads(texts[1][1])
        assert report["describes"]
        assert report["best"] == "ideal cavity"
        possible = [one["hypothesis"] for one in report["hypotheses"] if one["excluded"] is None]
        assert f"± is the range over what is possible: {', '.join(possible)}" in texts[0][1]
        written = [Path(f"{base}.{suffix}").read_text() for suffix in ("toml", "svg")]

        def common(text, file=file, base=base):
            layout = text.split("\nThe file as it was read")[0].replace("python -m vines", "vines")
            return layout.replace(str(file), "FILE").replace(str(base), "BASE")

        found.append([[common(str(part)) for part in text] for text in (*texts, written)])
    assert found[1] == found[0]
    assert found[2] == found[0]


def test_a_signal_ends_a_long_calculation_with_its_exit_code(tracked, tmp_path):
    # A fit of so many points outlasts the limit below by far.
    (tmp_path / "a.csv").write_text("\n".join([tracked[0], *5000 * tracked[1:]]))
    words = [*PYTHON, "fit", tmp_path / "a.csv"]
    signals = (signal.SIGINT, signal.SIGTERM)
    running = [subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in signals]
    for number, one in zip(signals, running, strict=True):
        assert one.stderr is not None
        assert one.stderr.readline().startswith("fitting: ")
        one.send_signal(number)
        out, err = one.communicate(timeout=120)
        assert (one.returncode, out) == (128 + number, "")
        assert err.endswith(f"error: interrupted by {number.name}\n")


def test_results_are_not_lost_where_the_encoding_has_no_sign_for_them(tracked, tmp_path):
    (tmp_path / "a.csv").write_text("\n".join(tracked))
    words = [*PYTHON, "fit", tmp_path / "a.csv"]
    code, out, err = call(*words, PYTHONIOENCODING="utf-8")
    assert (code, err, "±" in out) == (0, "", True)
    assert call(*words, PYTHONIOENCODING="ascii") == (0, out.replace("±", "?"), "")
    code, out, err = call(*words, "--response", "ξ", PYTHONIOENCODING="ascii")
    assert (code, out) == (2, "")
    assert "has no channel `?`" in err
    assert "Traceback" not in err


def test_tables_of_points_of_other_programs_give_the_counts_of_the_program(tracked, tmp_path):
    head, *rows = csv.reader(tracked)
    place = head.index("settled")

    def row(number, words, delimiter):
        cells = list(rows[number])
        cells[place] = words[number >= 6]
        return [cell.replace(".", ",") if delimiter == ";" else cell for cell in cells]

    printed = set()
    for words, delimiter in (("true false", ","), ("True False", ","), ("WAHR FALSCH", ";"), ("1 0", ";")):
        encoding = "utf-16" if delimiter == ";" else "utf-8"
        with (tmp_path / "a.csv").open("w", newline="", encoding=encoding) as file:
            table = csv.writer(file, delimiter=delimiter, lineterminator="\n")
            table.writerows([head, *(row(number, words.split(), delimiter) for number in range(8))])
        code, out, err = call(*PYTHON, "fit", tmp_path / "a.csv")
        assert code == 0, err
        assert re.search(r"ideal cavity .* 7 +\S+ +possible", out), "6 points: 12 equations for five parameters"
        assert "2 points are not settled" in out
        printed.add(out)
    assert len(printed) == 1


def test_an_option_of_another_command_is_refused(tmp_path):
    for option in ("--json", "--figure=a.svg", "--rate=3"):
        code, out, err = call(*PYTHON, "structure", tmp_path / "a.uff", "--cavity", "1Z", option)
        assert (code, out) == (2, "")
        assert f"unrecognized arguments: {option}" in err
    assert call(*PYTHON, "fit", "--help")[1].startswith("Fit the parameters of a rig")
    assert "structure" in call(*PYTHON, "--help")[1]


def test_a_scene_of_another_encoding_is_refused_with_what_it_is(tmp_path):
    file = tmp_path / "scene.toml"
    for encoding, words in (("utf-16", "is UTF-16; save it as UTF-8"), ("latin-1", "is not UTF-8 in line 2")):
        file.write_text("[plant]\nr = 0.7 # µ\n", encoding=encoding)
        with pytest.raises(ValueError, match=words):
            vines.Scene(file)
        code, out, err = call(os.environ["VINES"], "theory", "--scene", file)
        assert (code, out) == (2, "")
        assert words in err
    plant = "[plant]\nepsilon = 0.0084\nlambda = 1.4\nr = 0.7 # µ\n[excitation]\nG = 1.1\n"
    file.write_text(plant, encoding="utf-8-sig")
    assert vines.Scene(file).dimensionless["r"] == 0.7


def test_a_ring_down_without_a_base_is_a_linear_decay_in_the_package_and_on_the_command_line(tmp_path):
    time = 1e-3 * np.arange(8000)
    noise = np.random.default_rng(3).normal(size=time.size)
    omega, zeta = vines.Scene().dimensionless["omega0"], 0.008
    response = np.exp(-zeta * omega * time) * np.sin(np.sqrt(1 - zeta**2) * omega * time) + 1e-3 * noise
    scipy.io.savemat(tmp_path / "ring.mat", {"t": time, "acc1": response})
    decay = vines.linear_decay(vines.read_recording(tmp_path / "ring.mat", "acc1:mm"))
    for (value, uncertainty), truth in ((decay.f0, omega / (2 * np.pi)), (decay.zeta, zeta)):
        assert abs(value - truth) < 4 * uncertainty < 0.04 * truth
    command = [sys.executable, "-m", "vines", "fit", tmp_path / "ring.mat", "--response", "acc1:mm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "no impacts: this is a linear decay" in done.stdout
    done = subprocess.run([*command, "--time", "clock"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "no channel `clock`" in done.stderr


def test_accelerations_of_another_simulator_in_12_bits_with_hum_offset_and_drift_give_the_parameters(tmp_path):
    path = Path(__file__).parents[2] / "studies" / "foreign_recordings.py"
    spec = importlib.util.spec_from_file_location("foreign_recordings", path)
    foreign = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = foreign
    spec.loader.exec_module(foreign)
    chain = foreign.Chain(bits=12, hum=0.01, offset=0.3, drift=0.2, late=1)
    schedule = []
    for g in (1.6, 1.45, 1.3, 1.2, 1.1):
        scene = vines.Scene(plant=foreign.HIDDEN, resonance={"sensor": "q1"}, excitation={"G": g})
        orbit = next(one for one in vines.orbits(scene) if one.stable)
        drive = scene.drive(sigma=orbit.sigma, G=g)
        schedule.append((drive["amplitude"], drive["omega"]))
    file = tmp_path / "foreign.csv"
    foreign.write(file, foreign.recorded(foreign.simulate(schedule, 40, chain), chain, 1), chain)
    read = vines.read_recording(file, "aq", "base", late=1.0 / foreign.RATE)
    assert read.measured == ("acceleration", "acceleration")
    # Five levels do not separate b and epsilon; a ruler does.
    fit = vines.fit_recordings(read, vines.Scene(resonance={"sensor": "q1"}), known={"b": (0.0095, 5e-5)})
    for symbol, truth in (("r", foreign.HIDDEN["r"]), ("epsilon", foreign.HIDDEN["m"] / foreign.HIDDEN["M"])):
        value, uncertainty = fit[symbol]
        assert abs(value - truth) < 3 * uncertainty < 0.1 * value
    # The default v is what no accelerometer reads: a file of another program is refused with the key to set.
    with pytest.raises(ValueError, match=r'resonance\.sensor = "q1"'):
        vines.fit_recordings(read)


def test_a_recording_of_a_structure_with_several_modes_is_refused():
    scene = vines.Scene(Path(__file__).parents[2] / "scenes" / "cantilever.toml")
    time = 1e-3 * np.arange(10_000)
    turn = 2 * np.pi * 8.8 * time
    recording = vines.Recording("rig", ("y", "x"), 1e-3, 1e-3 * np.sin(turn), 1e-5 * np.cos(turn))
    with pytest.raises(ValueError, match="one oscillator, and the structure has 3 modes"):
        vines.fit_recordings(recording, scene)
