"""Start values, Initialization Mode, reset."""

from math import pi

import pytest

RIG = {"M": 2.0, "k": 300.0, "c": 1.5, "m": 0.05, "b": 0.02, "r": 0.7}
STATE = {"q1": 0.01, "der(q1)": -0.3, "q2": 0.02, "der(q2)": 0.4}
DRIVE = {"E": 0.002, "omega": 12.0}


def test_the_states_given_are_read_back_as_they_were_set(instance):
    plant = instance("LoViNes").start(RIG | STATE)
    for name, value in (RIG | STATE).items():
        assert plant.get(name) == value


def test_the_derived_outputs_follow_from_the_start(instance):
    plant = instance("LoViNes").start(RIG | STATE | {"e": 0.004})
    assert plant.get("v") == pytest.approx(0.01 + 0.05 / 2 * 0.02, rel=1e-15)
    assert plant.get("w") == pytest.approx(-0.01, rel=1e-15)
    assert plant.get("der(w)") == pytest.approx(-0.7, rel=1e-15)
    assert plant.get("energy") == pytest.approx(0.5 * (2 * 0.09 + 0.05 * 0.16 + 300 * 0.006**2), rel=1e-14)
    for name in ("phase", "impacts", "impact_time", "impact_velocity", "contact", "dissipated"):
        assert plant.get(name) == 0


def test_the_base_follows_the_input_in_initialization_mode(instance):
    plant = instance("LoViNes")
    plant.slave.setupExperiment()
    plant.slave.enterInitializationMode()
    for value in (0.001, -0.003, 0.002):
        plant.set({"e": value})
        assert plant.get("base") == value
    plant.slave.exitInitializationMode()
    assert plant.get("base") == 0.002
    assert plant.get("der(q1)") == 0, "where the base stands at the start is no jump"


def test_start_values_can_be_set_again_in_initialization_mode(instance):
    plant = instance("LoViNes")
    plant.set(RIG)
    plant.slave.setupExperiment()
    plant.slave.enterInitializationMode()
    plant.set(STATE)
    assert plant.get("w") == pytest.approx(-0.01, rel=1e-15)
    plant.set({"q1": 0.015})
    assert plant.get("w") == pytest.approx(-0.005, rel=1e-15)
    plant.slave.exitInitializationMode()
    assert plant.get("q1") == 0.015


def test_the_controller_starts_silent_at_its_start_frequency(instance):
    controller = instance("PhaseLock").start({"omega_start": 50.0})
    assert controller.get("omega") == 50.0
    for name in ("E", "drive", "phase_error", "locked", "settled", "state"):
        assert controller.get(name) == 0


def plant_history(plant):
    plant.start(RIG | STATE | DRIVE)
    return [plant.outputs() for _ in range(50) if plant.step(0.02) is None]


def controller_history(controller):
    controller.start({"sample_time": 2 * pi / 55 / 100})
    controller.set({"active": True})
    history = []
    for n in range(200):
        controller.set({"response": 0.001 * ((7 * n) % 11 - 5), "reference": 1e-4 * ((3 * n) % 7 - 3)})
        controller.step(0.001)
        history.append(controller.outputs())
    return history


@pytest.mark.parametrize(("name", "history"), [("LoViNes", plant_history), ("PhaseLock", controller_history)])
def test_after_a_reset_an_instance_is_as_new_bit_for_bit(instance, name, history):
    used, fresh = instance(name), instance(name)
    first = history(used)
    used.slave.reset()
    assert history(used) == first
    assert history(fresh) == first


def test_a_reset_brings_the_start_values_back(instance):
    plant = instance("LoViNes").start(RIG | STATE)
    plant.slave.reset()
    plant.start()
    assert plant.get("M") == float(plant.fmu.variable("M").start)
    assert plant.get("q1") == 0
