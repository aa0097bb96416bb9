"""Instances in FMPy: outputs of a start, steps of any length, values that are refused, and what the log tells."""

import numpy as np
import pytest
from fmpy import simulate_fmu

from component import FMICallException
from coupling import Scene

STATES = ("q1", "der(q1)", "q2", "der(q2)")
START = Scene().plant() | {"q1": -0.42, "der(q1)": 0.01, "q2": -0.99, "der(q2)": -0.86}
DRIVEN = START | {"E": Scene().amplitude, "omega": 0.990417}


def test_the_derived_outputs_follow_from_the_start(instance):
    rig = {"M": 2.0, "k": 300.0, "c": 1.5, "m": 0.05, "b": 0.02, "r": 0.7}
    plant = instance("LoViNes").start(
        rig | {"q1": 0.01, "der(q1)": -0.3, "q2": 0.02, "der(q2)": 0.4} | {"e": 0.003, "E": 0.002, "omega": 10.0}
    )
    expected = {"v": 0.01 + 0.05 / 2 * 0.02, "w": -0.01, "der(w)": -0.7, "base": 0.003}
    expected["energy"] = 0.5 * (2 * 0.09 + 0.05 * 0.16 + 300 * 0.007**2)
    for name, value in expected.items():
        assert plant.get(name) == pytest.approx(value, rel=1e-14)
    for name in ("phase", "impacts", "impact_time", "impact_velocity", "contact", "dissipated"):
        assert plant.get(name) == 0
    plant.step(0.0123)
    assert plant.get("phase") == pytest.approx(0.123, rel=1e-15)
    assert plant.get("base") == pytest.approx(0.003 + 0.002 * np.sin(0.123), rel=1e-14)


def test_one_step_of_fifty_periods_equals_many_small_ones_in_an_experiment_that_starts_later(instance, figure):
    one, many = instance("LoViNes").start(DRIVEN), instance("LoViNes").start(DRIVEN, time=100.0)
    one.step(50 * 2 * np.pi)
    many.step(50 * 2 * np.pi / 4321, 4321)
    assert one.get("impacts") == many.get("impacts") > 50
    difference = max(abs(one.get(name) - many.get(name)) for name in STATES)
    figure("one step of 50 periods against 4321 steps: worst state", difference, below=1e-11)


def test_fmpy_simulates_the_plant(fmus, instance, figure):
    path = str(fmus["LoViNes"].path)
    found = simulate_fmu(path, stop_time=100, output_interval=0.5, start_values=DRIVEN, output=[*STATES, "impacts"])
    assert len(found) == 201
    plant = instance("LoViNes").start(DRIVEN)
    plant.step(100.0)
    difference = max(abs(found[name][-1] - plant.get(name)) for name in STATES)
    figure("simulate_fmu against one step, LoViNes: worst state", difference, below=1e-12)
    assert found["impacts"][-1] == plant.get("impacts") > 10


def test_fmpy_feeds_a_held_signal_to_the_plant(fmus):
    time = np.linspace(0, 1, 501)
    signal = np.array([(t, 1e-4 * np.sin(55.4 * t)) for t in time], dtype=[("time", float), ("e", float)])
    path = str(fmus["LoViNes"].path)
    found = simulate_fmu(path, stop_time=1, output_interval=0.002, input=signal, output=["base", "q1"])
    assert np.ptp(found["q1"]) > 1e-4
    assert np.abs(found["base"][1:] - signal["e"][:-1]).max() < 1e-15


def test_fmpy_simulates_the_controller(fmus):
    time = np.linspace(0, 1, 1001)
    omega = 55.4
    signal = np.array(
        [(t, -1e-3 * np.cos(omega * t), 1e-4 * np.sin(omega * t), True) for t in time],
        dtype=[("time", float), ("response", float), ("reference", float), ("active", bool)],
    )
    found = simulate_fmu(str(fmus["PhaseLock"].path), stop_time=1, output_interval=0.001, input=signal)
    assert len(found) == 1001
    assert found["E"][-1] == pytest.approx(9.246125558182298e-05)
    assert found["response_amplitude"][-1] == pytest.approx(1e-3, rel=0.05)
    assert found["state"][-1] == 2, "acquiring"


def polynomial_error(plant, oscillator, samples, order):
    """Worst difference of q1 when the sine comes as polynomials through input derivatives."""
    omega, amplitude = 0.990417, Scene().amplitude
    step = 2 * np.pi / omega / samples
    oscillator.start(DRIVEN)
    plant.start(START)
    reference = plant.fmu.variable("e").valueReference
    worst = 0.0
    for n in range(10 * samples):
        phase = omega * n * step
        derivatives = [amplitude * omega**k * np.sin(phase + k * np.pi / 2) for k in range(order + 1)]
        plant.set({"e": derivatives[0]})
        plant.slave.setRealInputDerivatives([reference] * order, range(1, order + 1), derivatives[1:])
        plant.step(step)
        oscillator.step(step)
        worst = max(worst, abs(plant.get("q1") - oscillator.get("q1")))
    assert plant.get("impacts") == oscillator.get("impacts") > 10
    return worst / amplitude


def test_a_signal_given_as_polynomials_approaches_the_oscillator(instance, figure):
    coarse, fine = (polynomial_error(instance("LoViNes"), instance("LoViNes"), samples, 3) for samples in (100, 200))
    figure("e as cubics, 100 samples a period: error of q1 over E", coarse, below=1e-4)
    # The error of a cubic goes with the fourth power of the step.
    figure("e as cubics: error at half the step over error", fine / coarse, between=(0, 1 / 8))


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
