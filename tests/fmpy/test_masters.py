"""What other masters read: bench.ssp, descriptions, the default tolerance. A test for each of their findings."""

import re
import subprocess
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.ssp.ssd import read_ssd

SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
SSC = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"
OMS = "{https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd}"
OSP = "{http://opensimulationplatform.com/SSP/OSPAnnotations}"
# 31 bits.
SAMPLE_TIME = 0.001134357339651615


def pack(vines: Path, folder: Path) -> Path:
    subprocess.run([vines, "pack", "--out", folder], check=True, stdout=subprocess.DEVNULL)
    return folder


@pytest.fixture(scope="module")
def bench(vines, tmp_path_factory) -> Path:
    return pack(vines, tmp_path_factory.mktemp("bench"))


def inside(archive: Path, name: str) -> ElementTree.Element:
    with zipfile.ZipFile(archive) as files:
        return ElementTree.fromstring(files.read(name))


@pytest.fixture(scope="module")
def structure(bench) -> ElementTree.Element:
    return inside(bench / "bench.ssp", "SystemStructure.ssd")


def test_the_system_file_holds_the_step_size_where_omsimulator_and_libcosim_look(structure):
    system = structure.find(f"{SSD}System")
    (master,) = system.findall(
        f"{SSD}Annotations/{SSC}Annotation[@type='org.openmodelica']/{OMS}Annotations/{OMS}SimulationInformation"
        f"/{OMS}FixedStepMaster"
    )
    assert float(master.get("stepSize")) == SAMPLE_TIME
    experiment = structure.find(f"{SSD}DefaultExperiment")
    (algorithm,) = experiment.findall(
        f"{SSD}Annotations/{SSC}Annotation[@type='com.opensimulationplatform']/{OSP}Algorithm/{OSP}FixedStepAlgorithm"
    )
    assert float(algorithm.get("baseStepSize")) == SAMPLE_TIME
    # OMSimulator's command line rejects this element, which says no more than the geometry of the components does.
    assert structure.find(f".//{SSD}SystemGeometry") is None


def test_libcosim_finds_its_prefix_as_it_compares_it_letter_by_letter(bench):
    with zipfile.ZipFile(bench / "bench.ssp") as files:
        text = files.read("SystemStructure.ssd").decode()
    assert "<osp:Algorithm>" in text
    assert "<osp:FixedStepAlgorithm baseStepSize=" in text


def test_the_system_file_is_valid(bench):
    assert read_ssd(str(bench / "bench.ssp"), validate=True).version == "1.0"


def test_every_real_connector_has_the_unit_of_its_variable(bench, structure):
    defined = {unit.get("name") for unit in structure.iter(f"{SSC}Unit")}
    seen = 0
    for component in structure.iter(f"{SSD}Component"):
        description = read_model_description(str(bench / Path(component.get("source")).name))
        units = {one.name: one.unit for one in description.modelVariables}
        for connector in component.iter(f"{SSD}Connector"):
            kind = connector.find(f"{SSC}Real")
            if kind is not None:
                assert kind.get("unit") == units[connector.get("name")]
                assert kind.get("unit") in defined
                seen += 1
    assert seen == 10


def test_the_parameter_sets_have_names_of_their_own(bench):
    names = [inside(bench / "bench.ssp", f"resources/{name}.ssv").get("name") for name in ("plant", "controller")]
    assert names == ["plant", "controller"]


def test_the_system_file_sets_parameters_and_inputs_and_joins_outputs_to_inputs(bench, structure):
    causality = {}
    for component, fmu in (("plant", "LoViNes"), ("controller", "PhaseLock")):
        description = read_model_description(str(bench / f"{fmu}.fmu"))
        causality |= {(component, one.name): one.causality for one in description.modelVariables}
        for parameter in inside(bench / "bench.ssp", f"resources/{component}.ssv")[0]:
            assert causality[component, parameter.get("name")] in ("parameter", "input"), parameter.get("name")
    names = ("startElement", "startConnector", "endElement", "endConnector")
    wires = {tuple(map(wire.get, names)) for wire in structure.iter(f"{SSD}Connection")}
    assert wires == {
        ("plant", "v", "controller", "response"),
        ("plant", "base", "controller", "reference"),
        ("controller", "omega", "plant", "omega"),
        ("controller", "E", "plant", "E"),
    }
    assert {(causality[wire[:2]], causality[wire[2:]]) for wire in wires} == {("output", "input")}


def test_model_exchange_finds_every_impact_at_the_default_tolerance(fmus):
    experiment = {"stop_time": 10, "start_values": {"der(q2)": 0.5, "E": 9.2e-5, "omega": 54.9}, "output": ["impacts"]}
    path = str(fmus["LoViNes"].path)
    steps = simulate_fmu(path, fmi_type="CoSimulation", **experiment)
    exchanged = simulate_fmu(path, fmi_type="ModelExchange", solver="CVode", **experiment)
    assert steps["impacts"][-1] == 160
    assert exchanged["impacts"][-1] == 160


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_a_variable_that_repeats_its_unit_repeats_the_display_unit(fmus, name):
    repeated = 0
    for variable in fmus[name].description.modelVariables:
        declared = variable.declaredType
        if declared is not None and declared.displayUnit and variable.unit:
            assert variable.unit == declared.unit
            assert variable.displayUnit == declared.displayUnit, variable.name
            repeated += 1
    assert repeated > 10


def test_the_same_input_gives_the_same_bytes(bench, vines, tmp_path):
    again = pack(vines, tmp_path)
    for name in ("LoViNes.fmu", "PhaseLock.fmu", "bench.ssp"):
        assert (bench / name).read_bytes() == (again / name).read_bytes()


def test_the_page_shows_the_unit_of_every_real_variable(fmus):
    for name, fmu in fmus.items():
        page = (fmu.folder / "documentation" / "index.html").read_text()
        rows = dict(re.findall(r"<tr><td>(.*?)</td><td.*?>.*?</td><td.*?>(.*?)</td>", page))
        for variable in fmu.description.modelVariables:
            if variable.type == "Real":
                assert rows[variable.name] == (variable.unit or ""), f"{name}: {variable.name}"
    page = (fmus["LoViNes"].folder / "documentation" / "index.html").read_text()
    assert re.search(r"<tr><td>r</td><td.*?>0.65</td><td.*?>1</td>", page)
