"""The program as its users meet it."""

import csv
import json
import re
import subprocess
from xml.etree import ElementTree

import pytest

from references import ROOT

RESULTS = {"LoViNes.fmu", "identification.json", "backbone.csv", "backbone.svg", "history.svg", "sim.svg"}


@pytest.fixture
def call(vines, tmp_path):
    """Runs the program in an empty folder."""

    def call(*arguments: str) -> subprocess.CompletedProcess:
        return subprocess.run([vines, *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=600)

    return call


def succeeds(done: subprocess.CompletedProcess) -> None:
    """Asserts success without errors or warnings; a program that takes long writes lines of progress."""
    said = [line for line in done.stderr.splitlines() if not re.fullmatch(r"[^:]+: \d+ of \d+ \w+", line)]
    assert (done.returncode, said) == (0, [])


def printed(call, *arguments):
    done = call(*arguments)
    succeeds(done)
    return json.loads(done.stdout)


def test_identify_writes_its_results_and_they_keep_their_limits(call, tmp_path, figure):
    done = call("identify", "--out", "results")
    succeeds(done)
    for word in ("sigma", "exact", "theory", "symmetric 1:1", "RMS", "identification.json"):
        assert word in done.stdout
    folder = tmp_path / "results"
    assert {file.name for file in folder.iterdir()} >= RESULTS

    found = json.loads((folder / "identification.json").read_text())
    lock, exact, name = found["lock"], found["exact"], "identify"
    assert lock.keys() >= {
        "G", "sigma", "C", "B", "phase_error_deg", "periods_to_lock", "impacts_per_period", "motion"
    }  # fmt: skip
    assert found["theory"].keys() >= {"sigma", "C", "B"}
    assert exact.keys() >= {"sigma", "C", "B", "stable"}
    assert lock["regime_by_impacts"] == "symmetric 1:1"
    assert exact["stable"] is True
    figure(f"{name}: lock, sigma off the exact orbit", abs(lock["sigma"] - exact["sigma"]), below=5e-3)
    figure(f"{name}: lock, C off the exact orbit, relative", abs(lock["C"] / exact["C"] - 1), below=5e-3)
    figure(f"{name}: lock, B off the exact orbit, relative", abs(lock["B"] / exact["B"] - 1), below=5e-3)
    figure(f"{name}: phase error, degrees", abs(lock["phase_error_deg"]), below=0.3)
    figure(f"{name}: RMS of sigma less theory over C > 0.2", found["rms_sigma_error"], below=0.08)

    amplitudes = [point["C"] for point in found["decay"]]
    # A point per window's step over some 100 periods of decay, less the length of a window.
    assert len(amplitudes) > 80
    assert amplitudes[0] == max(amplitudes)
    assert amplitudes[-1] < 0.2
    with (folder / "backbone.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for key in ("sigma", "C"):
        assert [float(row[key]) for row in rows] == [point[key] for point in found["decay"]]
    for picture in ("backbone.svg", "history.svg", "sim.svg"):
        assert ElementTree.parse(folder / picture).getroot().tag.endswith("svg")


def test_a_rehearsal_ends_well_and_its_notebook_has_its_figures(tmp_path):
    done = subprocess.run(
        [ROOT / "scripts/rehearse", "--lock-step", "--out", tmp_path], capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    notebook = (tmp_path / "notebook.md").read_text()
    for words in (
        "signs, gains, delays and noise are as expected",
        "29 points in",
        "switched the drive off",
        "the drive was zero",
    ):
        assert words in notebook
    figures = re.findall(r"!\[.*\]\((.*)\)", notebook)
    assert figures
    for name in figures:
        ElementTree.parse(tmp_path / name)


def test_fit_reads_recordings_and_says_what_is_wrong_with_one(call, tmp_path):
    options = ["--set", "backbone.points=8", "--set", "chain.snr=60", "--set", "backbone.C_to=0.3"]
    assert call("backbone", *options, "--record", "run.csv").returncode == 0
    found = printed(call, "fit", "run.csv", "--set", "plant.r=0.7", "--set", "plant.b=0.0105", "--json")
    assert found["describes"]
    assert found["best"] == "ideal cavity"
    ideal, spring = found["hypotheses"][0], found["hypotheses"][-1]
    assert ideal["excluded"] is None
    assert spring["excluded"]
    (seconds,) = (one["seconds"] for one in found["stretches"] if one["motion"] == "1:1")
    assert seconds[1] - seconds[0] > 20.0
    for symbol, truth in (("r", 0.65), ("b", 0.01), ("epsilon", 0.032 / 3.807)):
        whole, narrow = (
            next(one for one in given["parameters"] if one["symbol"] == symbol) for given in (found, ideal)
        )
        assert abs(whole["value"] - truth) < 2 * whole["uncertainty"]
        assert abs(narrow["value"] - truth) < 4 * narrow["uncertainty"] < 0.1 * truth
    lines = (tmp_path / "run.csv").read_text().splitlines(keepends=True)
    (tmp_path / "gap.csv").write_text("".join(lines[:3000] + lines[3100:]))
    (tmp_path / "a record.mat").touch()
    for arguments, words in (
        (["gap.csv"], "gap.csv, row 3001: the time goes from"),
        (["a record.mat"], "`python -m vines fit 'a record.mat'`"),
        (["run.csv", "--response", "z"], "run.csv has no channel `z`; it has time, response"),
        (["run.csv", "--drive", "reference:-1", "--set", "resonance.sensor=v"], "wrong sign"),
        (["run.csv", "--drive", "response", "--response", "reference", "--set", "resonance.sensor=v"], "swapped"),
    ):
        done = call("fit", *arguments)
        assert done.returncode != 0
        assert words in done.stderr
