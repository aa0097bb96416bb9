"""Steps of any length, clocks that round, experiments that run on, and FMPy's own loop."""

from math import pi

import numpy as np
import pytest
from fmpy import simulate_fmu

from component import FMICallException
from coupling import SAMPLE_TIME, Scene

STATES = ("q1", "der(q1)", "q2", "der(q2)")
DRIVE = {"E": Scene().amplitude, "omega": 0.990417}
LOCKED = {"q1": -0.42, "der(q1)": 0.01, "q2": -0.99, "der(q2)": -0.86}


def plant_after(plant, lengths):
    plant.start(Scene().plant() | LOCKED | DRIVE)
    for length in lengths:
        plant.step(length)
    return np.array(plant.group(*STATES).get()), plant.get("impacts")


def test_one_step_of_fifty_periods_equals_many_small_ones(instance, figure):
    total = 50 * 2 * pi
    one, impacts = plant_after(instance("LoViNes"), [total])
    many, counted = plant_after(instance("LoViNes"), [total / 4321] * 4321)
    assert impacts == counted
    figure("one step of 50 periods against 4321 steps: worst state", np.abs(one - many).max(), below=1e-11)


def test_uneven_steps_equal_even_ones(instance, figure):
    lengths = np.random.default_rng(1).exponential(1, 300)
    uneven, _ = plant_after(instance("LoViNes"), lengths)
    even, _ = plant_after(instance("LoViNes"), [lengths.sum() / 100] * 100)
    figure("300 uneven steps against 100 even ones: worst state", np.abs(uneven - even).max(), below=1e-11)


def test_a_clock_that_deviates_by_1e_12_is_tolerated(instance, figure):
    exact, rough = (instance("LoViNes").start(Scene().plant() | LOCKED | DRIVE) for _ in range(2))
    deviations = np.random.default_rng(2).uniform(-1e-12, 1e-12, (1000, 2))
    for early, long in deviations:
        exact.step(SAMPLE_TIME)
        rough.slave.doStep(rough.time * (1 + early), SAMPLE_TIME * (1 + long))
        rough.time += SAMPLE_TIME
    difference = max(abs(exact.get(name) - rough.get(name)) for name in STATES)
    figure("steps that deviate by 1e-12, ten periods: worst state", difference, below=1e-10)


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_a_step_past_the_stop_time_is_refused_but_for_rounding(instance, name):
    component = instance(name, logging=True).start(stop=0.1)
    component.step(0.03, 3)
    with pytest.raises(FMICallException):
        component.step(0.03)
    assert any("stopTime = 0.1 s" in message.text for message in component.messages)
    component.step(0.1 - 0.09 + 1e-12)


@pytest.mark.parametrize("name", ["LoViNes", "PhaseLock"])
def test_an_experiment_may_start_later_than_zero(instance, name):
    early, late = instance(name).start(), instance(name).start(time=100.0)
    for component in (early, late):
        component.step(0.01, 10)
    for output, value in early.outputs().items():
        if output != "impact_time":
            assert late.get(output) == pytest.approx(value, rel=1e-9, abs=1e-12)


def test_the_controller_counts_its_own_samples(instance):
    drives = []
    for length, count in ((0.01, 10), (0.005, 20), (0.05, 2), (0.1, 1)):
        controller = instance("PhaseLock").start({"sample_time": 0.001, "bandwidth": 5.0})
        controller.set({"active": True})
        controller.step(length, count)
        drives.append(controller.get("drive"))
    assert drives[0] != 0
    assert drives == drives[:1] * len(drives)


def test_fmpy_simulates_the_plant(fmus, instance, figure):
    start = Scene().plant() | LOCKED | DRIVE
    outputs = [*STATES, "impacts"]
    path = str(fmus["LoViNes"].path)
    found = simulate_fmu(path, stop_time=100, output_interval=0.5, start_values=start, output=outputs)
    assert len(found) == 201
    plant = instance("LoViNes").start(start)
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
