"""What the FMUs say of themselves."""

import pytest
from fmpy import simulate_fmu, supported_platforms
from fmpy.validation import validate_fmu

PLANT = {
    "parameter": {"M": "kg", "k": "N/m", "c": "N.s/m", "m": "kg", "b": "m", "r": "1"}
    | {"q1_start": "m", "der_q1_start": "m/s", "q2_start": "m", "der_q2_start": "m/s"}
    | {"b_plus": "m", "b_minus": "m", "theta": "rad", "mu_k": "1", "mu_s": "1", "r_law": None, "r_min": "1"}
    # The law decides on the unit of its parameters.
    | {"r_plus": None, "r_minus": None, "r_scatter": "1", "seed": None},
    "input": {"e": "m", "E": "m", "omega": "rad/s"},
    "output": {
        "q1": "m",
        "der(q1)": "m/s",
        "q2": "m",
        "der(q2)": "m/s",
        "v": "m",
        "w": "m",
        "der(w)": "m/s",
        "base": "m",
        "phase": "rad",
        "impacts": None,
        "impact_time": "s",
        "impact_velocity": "m/s",
        "contact": None,
        "energy": "J",
        "dissipated": "J",
        "sticks": None,
        "stuck_time": "s",
        "friction_loss": "J",
    },
}
CONTROLLER = {
    "parameter": {
        "sample_time": "s",
        "omega_start": "rad/s",
        "omega_min": "rad/s",
        "omega_max": "rad/s",
        "amplitude": "m",
        "phase_target": "rad",
        "bandwidth": "rad/s",
    },
    "input": {"response": "m", "reference": "m", "active": None},
    "output": {
        "omega": "rad/s",
        "E": "m",
        "drive": "m",
        "phase_error": "rad",
        "response_amplitude": "m",
        "locked": None,
        "state": None,
    },
}
TYPES = {"impacts": "Integer", "contact": "Integer", "active": "Boolean", "locked": "Boolean", "state": "Integer"} | {
    "sticks": "Integer",
    "r_law": "Integer",
    "seed": "Integer",
}


def units(fmu, causality):
    return {name: fmu.variable(name).unit for name in fmu.names(causality)}


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
    assert description.variableNamingConvention == "structured"
    assert "linux64" in supported_platforms(str(fmus[name].path))


@pytest.mark.parametrize("causality", PLANT)
def test_the_plant_has_exactly_its_variables_in_si_units(fmus, causality):
    assert units(fmus["LoViNes"], causality) == PLANT[causality]


@pytest.mark.parametrize("causality", CONTROLLER)
def test_the_controller_has_at_least_its_variables_in_si_units(fmus, causality):
    found = units(fmus["PhaseLock"], causality)
    assert {name: found.get(name, "missing") for name in CONTROLLER[causality]} == CONTROLLER[causality]


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_types_and_descriptions_are_right(fmus, name):
    for variable in fmus[name].description.modelVariables:
        assert variable.description, f"{variable.name} has no description"
        assert variable.type == TYPES.get(variable.name, variable.type)


def test_the_states_of_the_plant_can_be_set_at_the_start(fmus):
    for name in ("q1", "der(q1)", "q2", "der(q2)"):
        assert fmus["LoViNes"].variable(name).initial == "exact"


def test_amplitude_and_phase_target_can_be_tuned_while_it_runs(fmus):
    for name in ("amplitude", "phase_target"):
        assert fmus["PhaseLock"].variable(name).variability == "tunable"
    assert float(fmus["PhaseLock"].variable("phase_target").start) == pytest.approx(-1.5707963267948966)


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_every_real_variable_has_a_unit_and_says_of_what_kind_and_size_it_is(fmus, name):
    for variable in fmus[name].description.modelVariables:
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
