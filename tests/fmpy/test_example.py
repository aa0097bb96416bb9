"""The shell's own example, packed as its guide says and handed to FMPy."""

import os
import subprocess

import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from references import ROOT

EXAMPLE = ROOT / "fmi2-component/example"


@pytest.fixture(scope="module")
def tank(tmp_path_factory):
    """`Tank.fmu`, of a description and of a library that nobody here packs otherwise."""
    folder = tmp_path_factory.mktemp("tank")
    built = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "debug"
    library, pack = built / "deps" / "libfmi2_example_tank.so", built / "examples" / "pack"
    for file in (library, pack):
        assert file.is_file(), f"{file} is missing; `cargo test --workspace --no-run` builds it"
    subprocess.run([pack, EXAMPLE / "modelDescription.xml", library, folder], check=True, cwd=ROOT)
    return folder / "Tank.fmu"


def test_the_example_is_about_a_hundred_lines(figure):
    source = (EXAMPLE / "src/lib.rs").read_text().splitlines()
    code = [line for line in source if line.strip() and not line.strip().startswith("//")]
    figure("lines of the example component", len(code), below=130)


def test_fmpy_finds_no_problem_in_the_example_and_simulates_it(tank):
    assert validate_fmu(str(tank)) == []
    found = simulate_fmu(str(tank), stop_time=20, start_values={"inflow": 0.1}, output=["level", "overflows"])
    assert found["level"][40] == pytest.approx(0.5 + 0.1 / 2 * found["time"][40])
    assert found["level"][-1] == 1
    assert found["overflows"][-1] == 1
