"""What the FMUs say of themselves, their libraries, and the example of the shell."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu, supported_platforms
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from component import own_experiment
from references import ROOT

MAX_SIZE = {"LoViNes": 1_200_000, "PhaseLock": 1_000_000}
"""Bytes. The library of LoViNes.fmu is that of Structure.fmu as well, with the modes of matrices: a third of it."""


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_fmpy_finds_no_problem_in_the_fmu(fmus, name, figure):
    figure(f"{name}.fmu: problems found by FMPy", len(validate_fmu(str(fmus[name].path))), below=0)


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_the_fmu_is_a_co_simulation_component_for_this_platform(fmus, name):
    description = fmus[name].description
    assert description.fmiVersion == "2.0"
    assert description.modelName == name
    assert description.coSimulation.modelIdentifier == name
    assert description.coSimulation.canGetAndSetFMUstate
    assert description.coSimulation.canSerializeFMUstate
    assert description.coSimulation.canHandleVariableCommunicationStepSize
    exchange = description.modelExchange
    assert (exchange and exchange.modelIdentifier) == (name if name == "LoViNes" else None)
    assert description.variableNamingConvention == "flat"
    assert "linux64" in supported_platforms(str(fmus[name].path))


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_every_real_variable_has_a_unit_and_says_of_what_kind_and_size_it_is(fmus, name):
    for variable in fmus[name].description.modelVariables:
        assert variable.description, variable.name
        # The unit of these parameters depends on the law of restitution.
        if variable.type == "Real" and variable.name not in ("r_plus", "r_minus"):
            declared = variable.declaredType
            assert variable.unit, variable.name
            assert declared is not None or variable.quantity or variable.unit == "1", variable.name
            bounds = [one for one in (variable, declared) if one is not None]
            said = [one.min or one.max or one.nominal for one in bounds]
            assert any(said) or variable.quantity in ("Angle", "Time"), variable.name


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_the_default_experiment_is_complete(fmus, name):
    default = fmus[name].description.defaultExperiment
    for value in (default.startTime, default.stopTime, default.tolerance, default.stepSize):
        assert value is not None


def test_the_default_experiment_shows_impacts(fmus):
    default = fmus["LoViNes"].description.defaultExperiment
    assert float(default.startTime) == 0
    found = simulate_fmu(str(fmus["LoViNes"].path), output=["impacts", "impact_time"])
    assert found["time"][-1] == float(default.stopTime)
    assert found["impacts"][-1] > 1
    assert found["impact_time"][found["impacts"] > 0][0] == pytest.approx(0.01 / 0.015, rel=1e-9)


@pytest.mark.parametrize("name", MAX_SIZE)
def test_a_library_is_small_stripped_and_without_paths_of_the_machine_that_built_it(fmus, name):
    (library,) = Path(fmus[name].folder).glob("binaries/*/*")
    content = library.read_bytes()
    assert len(content) <= MAX_SIZE[name]
    # Names of sections are C strings. (Rust's standard library contains some of them as other text.)
    assert b"\0.dynsym\0" in content
    assert b"\0.symtab\0" not in content
    assert b"\0.debug_info\0" not in content
    for folder in (ROOT, Path.home(), Path.home() / ".cargo"):
        assert bytes(folder) + b"/" not in content, folder


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_the_experiment_inside_an_fmu_gives_the_results_beside_it_and_ends_in_a_lock(fmus, name, figure):
    found, errors = own_experiment(fmus[name])
    for column, off in errors.items():
        figure(f"{name}.fmu: its own experiment, {column} off, relative", off, below=1e-9)
    if name == "PhaseLock":
        assert found["locked"][-1]


TARGET = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
SHELL = ROOT / "fmi2-component"


def packed(description: Path, library: Path, folder: Path) -> str:
    """The FMU that `fmi2-pack` makes."""
    program = ("-p", "fmi2-component-build", "--features", "pack", "--bin", "fmi2-pack")
    done = subprocess.run(
        ["cargo", "run", "--locked", "--quiet", *program, "--", description, library, folder],
        check=True,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    return done.stdout.strip()


def test_fmpy_finds_no_problem_in_the_example_of_the_shell_and_simulates_it(tmp_path):
    library = TARGET / "debug" / "deps" / "libfmi2_example_tank.so"
    assert library.is_file(), f"{library} is missing; `cargo test --workspace --no-run` builds it"
    tank = packed(SHELL / "example" / "modelDescription.xml", library, tmp_path)
    assert validate_fmu(tank) == []
    found = simulate_fmu(tank, stop_time=20, start_values={"inflow": 0.1}, output=["level", "overflows"])
    assert found["level"][40] == pytest.approx(0.5 + 0.1 / 2 * found["time"][40])
    assert (found["level"][-1], found["overflows"][-1]) == (1, 1)


def test_a_copy_of_the_template_of_the_shell_becomes_an_fmu_that_fmpy_simulates(tmp_path):
    model = tmp_path / "lag"
    shutil.copytree(SHELL / "template", model)
    shutil.copy(ROOT / "Cargo.lock", model)
    # The crates of this repository, as long as no index has them.
    ours = {"fmi2-component": SHELL, "fmi2-component-build": SHELL / "build", "fmi2-description": SHELL / "description"}
    patches = [f'--config=patch.crates-io.{name}.path="{folder}"' for name, folder in ours.items()]
    target = TARGET / "template"
    subprocess.run(["cargo", "build", "--offline", "--quiet", "--target-dir", target, *patches], check=True, cwd=model)
    lag = packed(model / "modelDescription.xml", target / "debug" / "liblag.so", tmp_path)
    assert validate_fmu(lag) == []
    found = simulate_fmu(lag, stop_time=3, output_interval=0.5, start_values={"T": 2, "u": 1}, output=["y"])
    assert found["y"] == pytest.approx(1 - np.exp(-found["time"] / 2))
    with pytest.raises(FMICallException):
        simulate_fmu(lag, start_values={"T": 0})


def test_the_readme_of_the_shell_shows_the_template():
    text = (SHELL / "README.md").read_text()
    for file in ("src/lib.rs", "modelDescription.xml"):
        assert (SHELL / "template" / file).read_text() in text, file
    manifest = (SHELL / "template" / "Cargo.toml").read_text()
    assert manifest[manifest.index("[lib]") : manifest.index("\n[workspace]")] in text
