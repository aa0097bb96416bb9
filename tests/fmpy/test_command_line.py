"""The program as its users meet it."""

import csv
import json
import re
import subprocess
from math import isfinite
from pathlib import Path
from xml.etree import ElementTree

import pytest

from references import ROOT, orbits

RESULTS = {"LoViNes.fmu", "identification.json", "backbone.csv", "backbone.svg", "history.svg", "sim.svg"}
BAD_INPUT = {
    "plant.rr=0.5": "rr",
    "nonsense": "section.key=value",
    "plant.r=2": "r (coefficient of restitution) = 2",
    "plant.M=-1": "M (primary mass) = -1",
    "plant.k=nan": "k (stiffness) = NaN",
    "start.q2=0.02": "q2",
    "controller.bandwidth=-1": "bandwidth",
}


@pytest.fixture
def call(vines, tmp_path):
    """Runs the program in an empty folder."""

    def call(*arguments: str) -> subprocess.CompletedProcess:
        return subprocess.run([vines, *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=600)

    return call


def printed(call, *arguments):
    done = call(*arguments)
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout)


def dimensionless(row):
    scene = ROOT / "scenes" / "dimensionless.toml"
    keys = {"plant.epsilon": "eps", "plant.lambda": "lam", "plant.r": "r", "excitation.G": "G"}
    values = [word for key, name in keys.items() for word in ("--set", f"{key}={row[name]!r}")]
    return ["--scene", str(scene), *values]


@pytest.mark.parametrize("options", [[], ["--set", "plant.r=0.7"]], ids=["default", "r = 0.7"])
def test_identify_writes_its_results_and_they_keep_their_limits(call, tmp_path, figure, options):
    done = call("identify", *options, "--out", "results")
    assert (done.returncode, done.stderr) == (0, "")
    for word in ("sigma", "exact", "theory", "symmetric 1:1", "RMS", "identification.json"):
        assert word in done.stdout
    folder = tmp_path / "results"
    assert {file.name for file in folder.iterdir()} >= RESULTS

    found = json.loads((folder / "identification.json").read_text())
    lock, exact, name = found["lock"], found["exact"], f"identify {' '.join(options[1:])}".strip()
    assert lock.keys() >= {
        "G", "sigma", "C", "B", "phase_error_deg", "periods_to_lock", "impacts_per_period", "regime"
    }  # fmt: skip
    assert found["theory"].keys() >= {"sigma", "C", "B"}
    assert exact.keys() >= {"sigma", "C", "B", "stable"}
    assert lock["regime"] == "symmetric 1:1"
    assert exact["stable"] is True
    figure(f"{name}: lock, sigma off the exact orbit", abs(lock["sigma"] - exact["sigma"]), below=5e-3)
    figure(f"{name}: lock, C off the exact orbit, relative", abs(lock["C"] / exact["C"] - 1), below=5e-3)
    figure(f"{name}: lock, B off the exact orbit, relative", abs(lock["B"] / exact["B"] - 1), below=5e-3)
    figure(f"{name}: phase error, degrees", abs(lock["phase_error_deg"]), below=0.3)
    figure(f"{name}: RMS of sigma less theory over C > 0.2", found["rms_sigma_error"], below=0.08)

    check_decay(found["decay"])
    check_csv(folder / "backbone.csv", found["decay"])
    for picture in ("backbone.svg", "history.svg", "sim.svg"):
        assert ElementTree.parse(folder / picture).getroot().tag.endswith("svg")


def check_decay(points):
    # A point per window's step over some 100 periods of decay, less the length of a window.
    assert len(points) > 80
    for point in points:
        assert point.keys() >= {"tau", "C", "B", "sigma", "sigma_theory"}
        assert all(isfinite(point[key]) for key in ("tau", "C", "B", "sigma"))
    amplitudes = [point["C"] for point in points]
    assert amplitudes[0] == max(amplitudes)
    assert amplitudes[-1] < 0.2


def check_csv(path: Path, points):
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["sigma"]) for row in rows] == [point["sigma"] for point in points]
    assert [float(row["C"]) for row in rows] == [point["C"] for point in points]


def test_identify_says_so_when_the_drive_is_not_reached(call, tmp_path):
    done = call("identify", "--set", "start.dq2=0.0", "--set", "excitation.G=0.5", "--out", "results")
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert "1:1" in done.stderr
    assert not (tmp_path / "results" / "identification.json").exists()
    assert (tmp_path / "results" / "interrupted.csv").read_text().startswith("time,response,")


def test_orbit_finds_the_reference_orbits(call, figure):
    worst = 0.0
    for row in orbits():
        found = printed(call, "orbit", *dimensionless(row), "--json")
        orbit = min(found, key=lambda orbit: abs(orbit["sigma"] - row["sigma"]))
        worst = max(worst, *(abs(orbit[key] - row[key]) for key in ("sigma", "C", "B")))
        assert sorted(orbit["multipliers"]) == pytest.approx([row[f"mult{n}"] for n in range(1, 5)], abs=1e-5)
        assert orbit["stable"] == (row["mult4"] < 1)
    figure("vines orbit against orbits.csv: worst of sigma, C, B", worst, below=1e-8)


def test_theory_gives_the_first_order_solutions_of_the_reference(call, figure):
    worst = 0.0
    for row in orbits():
        found = printed(call, "theory", *dimensionless(row), "--json")
        solution = min(found["solutions"], key=lambda one: abs(one["sigma"] - row["sigma_msm"]))
        worst = max(worst, *(abs(solution[key] - row[f"{key}_msm"]) for key in ("sigma", "C", "B")))
    figure("vines theory against orbits.csv: worst of sigma, C, B", worst, below=1e-8)


@pytest.mark.parametrize("command", ["identify", "orbit", "theory"])
@pytest.mark.parametrize("value", BAD_INPUT)
def test_bad_input_ends_with_one_message_and_nothing_written(call, tmp_path, command, value):
    done = call(command, "--set", value)
    check_refusal(done, BAD_INPUT[value], tmp_path)


def test_a_missing_scene_is_named(call, tmp_path):
    check_refusal(call("identify", "--scene", "no-such.toml"), "no-such.toml", tmp_path)


def test_an_unknown_key_in_a_scene_is_shown_with_its_line(call, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text((ROOT / "scenes" / "dimensionless.toml").read_text() + "\n[record]\nlock_period = 3\n")
    done = call("identify", "--scene", "scene.toml")
    scene.unlink()
    check_refusal(done, "lock_period", tmp_path)


def test_a_plant_that_is_no_fmu_is_refused(call, tmp_path):
    (tmp_path / "rig.fmu").write_text("no archive")
    done = call("identify", "--rig", "rig.fmu")
    assert done.returncode != 0
    assert done.stderr.startswith("error: ")
    assert "rig.fmu" in done.stderr
    assert not (tmp_path / "out").exists()


def check_refusal(done, part, folder):
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert part in done.stderr
    assert "panicked" not in done.stderr
    assert done.stdout == ""
    assert list(folder.iterdir()) == []


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
    assert sum(part["kind"] == "held" for part in found["parts"]) >= 6
    for symbol, truth in (("r", 0.65), ("b", 0.01), ("epsilon", 0.032 / 3.807)):
        one = next(one for one in found["parameters"] if one["symbol"] == symbol)
        assert abs(one["value"] - truth) < 4 * one["uncertainty"] < 0.5 * truth
    lines = (tmp_path / "run.csv").read_text().splitlines(keepends=True)
    (tmp_path / "gap.csv").write_text("".join(lines[:3000] + lines[3100:]))
    (tmp_path / "record.mat").touch()
    for arguments, words in (
        (["gap.csv"], "gap.csv, row 3001: the time goes from"),
        (["record.mat"], "`python -m vines fit record.mat`"),
        (["run.csv", "--response", "z"], "run.csv has no channel `z`; it has time, response"),
        (["run.csv", "--drive", "reference:-1"], "wrong sign"),
        (["run.csv", "--drive", "response", "--response", "reference"], "swapped"),
    ):
        done = call("fit", *arguments)
        assert done.returncode != 0
        assert words in done.stderr
