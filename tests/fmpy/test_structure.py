"""Structure.fmu of presets: valid for FMPy, and simulated in steps of any length."""

import json
import subprocess
from contextlib import closing
from pathlib import Path

import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from component import Component, Fmu
from references import ROOT

POINTS = [f"{quantity}[{{}}]" for quantity in "qva"]


@pytest.fixture(scope="module", params=["cantilever", "frame"])
def structure(request: pytest.FixtureRequest, vines: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    # A path that masters have to encode.
    folder = tmp_path_factory.mktemp("größe 1")
    scene = ROOT / "scenes" / f"{request.param}.toml"
    subprocess.run([vines, "pack", "--scene", scene, "--out", folder], check=True, stdout=subprocess.DEVNULL)
    assert sorted(path.name for path in folder.iterdir()) == ["PhaseLock.fmu", "Structure.fmu"]
    return Fmu.unpack(folder / "Structure.fmu", folder / "unpacked")


def described(fmu: Fmu) -> dict:
    return json.loads((fmu.folder / "resources" / "structure.json").read_text())


def drive(fmu: Fmu) -> dict[str, float]:
    """A drive near the lowest frequency that makes the particle hit the walls."""
    of = described(fmu)
    amplitude, size = ("E", 1e-4) if of["excitation"] == "Base" else ("F_amplitude", 1.2)
    omega = min(mode["omega"] for mode in of["equations"]["modes"])
    return {amplitude: size, "omega": 0.99 * omega}


def test_the_description_is_valid_and_has_outputs_at_the_points(structure):
    assert validate_fmu(str(structure.path)) == []
    points = [point["name"] for point in described(structure)["points"]]
    expected = [name.format(point) for point in points for name in POINTS]
    assert [name for name in structure.names("output") if "[" in name] == expected
    assert "M" not in structure.names("parameter")


def test_fmpy_simulates_it_and_steps_of_any_length_agree(structure):
    point = described(structure)["points"][0]["name"]
    outputs = [name.format(point) for name in POINTS] + ["q2", "impacts"]
    start = drive(structure) | {"der(q2)": 0.5}
    result = simulate_fmu(str(structure.path), stop_time=3, output_interval=1e-3, start_values=start, output=outputs)
    assert result["impacts"][-1] > 10
    with closing(Component(structure)) as coarse:
        coarse.start(start)
        coarse.step(0.5, 6)
        assert coarse.get("impacts") == result["impacts"][-1]
        for name in outputs[:-1]:
            size = max(map(abs, result[name].tolist()))
            assert coarse.get(name) == pytest.approx(float(result[name][-1]), abs=1e-7 * size)
