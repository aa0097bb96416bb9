"""FMPy: the reference among the validators, and a simulator of system files."""

import zipfile

import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.ssp.ssd import read_ssd
from fmpy.validation import validate_fmu

COMPONENTS = ("plant", "controller")


@pytest.mark.parametrize("component", COMPONENTS)
def test_fmpy_finds_nothing_wrong_with_the_fmu(bench, component):
    assert validate_fmu(str(bench.fmu(component))) == []


def test_the_plant_alone_simulates_and_hits_its_walls(bench):
    start = {"der(q2)": 0.5, "E": 9.2e-5, "omega": 54.9}
    rows = simulate_fmu(
        str(bench.fmu("plant")), stop_time=2, output_interval=1e-3, output=["w", "impacts"], start_values=start
    )
    assert rows["impacts"][-1] > 10
    assert abs(rows["w"]).max() <= 0.01


def test_the_system_file_is_valid_by_the_schema(bench):
    structure = read_ssd(str(bench.system), validate=True)
    assert structure.version == "1.0"
    with zipfile.ZipFile(bench.system) as archive:
        inside = set(archive.namelist())
    assert {component.source for component in structure.system.elements} <= inside


def test_the_wires_join_outputs_to_inputs_of_the_fmus(bench):
    causality = {
        component: {one.name: one.causality for one in read_model_description(str(bench.fmu(component))).modelVariables}
        for component in COMPONENTS
    }
    wires = {(wire.source, wire.output, wire.target, wire.input) for wire in bench.wires}
    assert wires == {
        ("plant", "v", "controller", "response"),
        ("plant", "base", "controller", "reference"),
        ("controller", "omega", "plant", "omega"),
        ("controller", "E", "plant", "E"),
    }
    for source, output, target, input_ in wires:
        assert (causality[source][output], causality[target][input_]) == ("output", "input")


@pytest.mark.parametrize("component", COMPONENTS)
def test_every_parameter_of_the_fmu_is_bound_and_every_bound_value_can_be_set(bench, component):
    variables = {one.name: one for one in read_model_description(str(bench.fmu(component))).modelVariables}
    bound = bench.values(component)
    parameters = {name for name, variable in variables.items() if variable.causality == "parameter"}
    assert parameters <= bound.keys()
    for name in bound:
        assert variables[name].causality == "input" or variables[name].initial == "exact", name


def test_the_system_file_locks_where_the_lab_does(bench, play, check_lock):
    check_lock("FMPy, system file", bench, play("fmpy", "system file", bench))
