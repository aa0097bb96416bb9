"""Values that make no sense are refused with a message that names them, their unit and what is allowed.

Debug logging is off: the reason of a refusal is told all the same.
"""

from math import inf, nan

import pytest

from component import FMICallException

BAD_PLANTS = [
    ({"M": -1}, ["M", "-1 kg", "from 1e-100 to 1e100"]),
    ({"k": 0}, ["k", "0 N/m", "from 1e-100 to 1e100"]),
    ({"c": -0.5}, ["c", "-0.5 N.s/m", "from 0 to 1e100"]),
    ({"m": nan}, ["m", "NaN", "kg", "finite number"]),
    ({"b": inf}, ["b", "inf", "m", "finite number"]),
    ({"r": 1.5}, ["r", "1.5", "above 0 and at most 1"]),
    ({"r": 0}, ["r", "0", "above 0 and at most 1"]),
    ({"q2": 0.02}, ["q1 - q2", "-0.02 m", "cavity", "-b_minus to b_plus"]),
    ({"der(q1)": -inf}, ["der(q1)", "inf", "m/s", "finite number"]),
    ({"E": nan}, ["E", "NaN", "m", "finite number"]),
]
BAD_CONTROLLERS = [
    ({"sample_time": 0}, ["sample_time", "0 s", "above 0"]),
    ({"omega_max": 1}, ["omega_max", "1 rad/s", "above omega_min"]),
    ({"omega_start": 1000}, ["omega_start", "1000 rad/s", "between omega_min and omega_max"]),
    ({"amplitude": -1e-4}, ["amplitude", "-0.0001 m", "0 or above"]),
    ({"bandwidth": nan}, ["bandwidth", "NaN", "rad/s", "finite number"]),
    ({"phase_target": 4}, ["phase_target", "4 rad", "between -pi and pi"]),
    ({"detector": 3}, ["detector", "3", "1 (adaptive) or 2 (demodulator)"]),
]


def named(case):
    return " ".join(f"{name}={value}" for name, value in case.items()) if isinstance(case, dict) else "is named"


def check_refusal(component, values, words):
    with pytest.raises(FMICallException):
        component.start(values)
    log = "\n".join(message.text for message in component.messages if message.status > 1)
    missing = [word for word in words if word not in log]
    assert not missing, f"{missing} not in the log: {log!r}"
    assert all(message.category == "logStatusError" for message in component.messages if message.status > 1)


@pytest.mark.parametrize(("values", "words"), BAD_PLANTS, ids=named)
def test_a_plant_that_makes_no_sense_is_refused(instance, values, words):
    check_refusal(instance("LoViNes"), values, words)


@pytest.mark.parametrize(("values", "words"), BAD_CONTROLLERS, ids=named)
def test_a_controller_that_makes_no_sense_is_refused(instance, values, words):
    check_refusal(instance("PhaseLock"), values, words)


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_a_refused_instance_can_be_reset_and_used(instance, name):
    component = instance(name)
    bad = {"LoViNes": {"M": -1}, "PhaseLock": {"sample_time": 0}}[name]
    with pytest.raises(FMICallException):
        component.start(bad)
    component.slave.reset()
    component.start().step(0.01)


def test_an_input_that_is_no_number_is_refused_between_steps(instance):
    plant = instance("LoViNes").start()
    plant.step(0.01)
    with pytest.raises(FMICallException):
        plant.set({"omega": nan})
    assert "omega" in plant.messages[-1].text


def test_a_parameter_cannot_be_changed_while_the_plant_runs(instance):
    plant = instance("LoViNes").start()
    with pytest.raises(FMICallException):
        plant.set({"M": 2})
    assert "M cannot be set" in plant.messages[-1].text


def test_an_amplitude_above_its_limit_is_refused_before_and_after_the_first_step(instance):
    controller = instance("PhaseLock").start({"amplitude_max": 4e-4})
    for time in (0.0, 0.1):
        controller.messages.clear()
        with pytest.raises(FMICallException):
            controller.set({"amplitude": 5e-4})
        assert "amplitude = 0.0005 m is refused" in controller.messages[-1].text
        assert controller.get("amplitude") < 4e-4
        controller.step(0.1)
        assert controller.time == pytest.approx(time + 0.1)


def test_a_move_that_makes_no_sense_can_be_corrected(instance):
    controller = instance("PhaseLock").start({"amplitude_max": 4e-4, "signal_timeout": -1, "residual_max": -1})
    controller.set({"active": True})
    controller.step(0.001, 1000)
    assert controller.get("state") == 2, "acquiring"
    controller.set({"hold_response": True, "move.response": -0.01})
    with pytest.raises(FMICallException):
        controller.step(0.001)
    assert "response = -0.01 m is refused" in controller.messages[-1].text
    controller.set({"move.response": 0.01})
    controller.step(0.001)


def test_a_fault_is_told_in_words(instance):
    controller = instance("PhaseLock", logging=True).start()
    controller.set({"active": True})
    controller.step(0.001, 10000)
    told = [message.text for message in controller.messages if message.category == "logEvents"]
    assert any("acquiring -> tripped at t = " in text and "could not be measured" in text for text in told), told
    assert not any(word in text for text in told for word in ("Some", "None", "NoSignal")), told


def test_the_log_tells_of_impacts_when_asked_to(instance):
    plant = instance("LoViNes", logging=True).start({"der(q2)": 0.5})
    plant.step(0.1)
    told = [message.text for message in plant.messages if message.category == "logImpacts"]
    assert len(told) == plant.get("impacts") > 0
