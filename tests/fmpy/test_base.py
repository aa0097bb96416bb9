"""The two ways to move the base: the signal e and the built-in oscillator."""

from math import cos, exp, pi, sin, sqrt

import pytest

RIG = {"M": 2.0, "k": 300.0, "c": 1.5, "m": 0.05, "b": 0.02, "r": 0.7}
JUMP = 0.004


def step_response(t):
    """Position and velocity of the primary mass after a jump of the base at t = 0, from rest."""
    decay, stiffness = RIG["c"] / (2 * RIG["M"]), RIG["k"] / RIG["M"]
    omega = sqrt(stiffness - decay**2)
    # y = q1 - e starts at -JUMP with the velocity that the jump of the base gives.
    y, dy = -JUMP, RIG["c"] * JUMP / RIG["M"]
    s = (dy + decay * y) / omega
    position = exp(-decay * t) * (y * cos(omega * t) + s * sin(omega * t))
    velocity = exp(-decay * t) * (s * omega * cos(omega * t) - y * omega * sin(omega * t)) - decay * position
    return position + JUMP, velocity


def test_a_jump_of_the_signal_gives_the_mass_the_velocity_c_de_over_m(instance, figure):
    plant = instance("LoViNes").start(RIG)
    plant.step(0.1)
    assert plant.get("der(q1)") == 0
    plant.set({"e": JUMP})
    assert plant.get("base") == JUMP
    plant.step(1e-12)
    expected = RIG["c"] * JUMP / RIG["M"]
    figure("velocity after a jump of e, off c de/M, relative", abs(plant.get("der(q1)") / expected - 1), below=1e-8)


def test_the_response_to_a_jump_is_the_closed_form(instance, figure):
    plant = instance("LoViNes").start(RIG)
    plant.step(0.1)
    plant.set({"e": JUMP})
    worst = 0.0
    for n in range(1, 101):
        plant.step(0.01)
        position, velocity = step_response(0.01 * n)
        worst = max(worst, abs(plant.get("q1") - position), abs(plant.get("der(q1)") - velocity))
        assert plant.get("impacts") == 0
    figure("response to a jump of e, worst error", worst, below=1e-14)


def test_a_jump_of_the_oscillator_is_the_same_jump(instance, figure):
    by_signal, by_oscillator = (instance("LoViNes").start(RIG | {"omega": pi}) for _ in range(2))
    for plant in (by_signal, by_oscillator):
        plant.step(0.5)
    by_signal.set({"e": JUMP, "omega": 0})
    by_oscillator.set({"E": JUMP, "omega": 0})
    for plant in (by_signal, by_oscillator):
        plant.step(0.7)
    difference = max(abs(by_signal.get(name) - by_oscillator.get(name)) for name in ("q1", "der(q1)", "base"))
    figure("jump by E at phase pi/2 against jump by e", difference, below=1e-15)


def test_the_base_is_the_sum_of_both(instance):
    plant = instance("LoViNes").start(RIG | {"e": 0.003, "E": 0.002, "omega": 10.0})
    plant.step(0.123)
    assert plant.get("phase") == pytest.approx(1.23, rel=1e-15)
    assert plant.get("base") == pytest.approx(0.003 + 0.002 * sin(1.23), rel=1e-14)


def test_the_phase_of_the_oscillator_is_continuous_and_kept_within_a_turn(instance):
    plant = instance("LoViNes").start(RIG | {"omega": 10.0})
    plant.step(0.5)
    plant.set({"omega": 20.0})
    assert plant.get("phase") == pytest.approx(5, rel=1e-15)
    plant.step(0.1)
    assert plant.get("phase") == pytest.approx(7 - 2 * pi, rel=1e-14)


def polynomial_error(plant, oscillator, samples, order):
    """Worst difference of q1 when the sine comes as polynomials through input derivatives."""
    omega, amplitude = 11.0, 0.002
    step = 2 * pi / omega / samples
    start = RIG | {"der(q2)": 0.1}
    oscillator.start(start | {"E": amplitude, "omega": omega})
    plant.start(start)
    reference = plant.fmu.variable("e").valueReference
    worst = 0.0
    for n in range(10 * samples):
        phase = omega * n * step
        derivatives = [amplitude * omega**k * sin(phase + k * pi / 2) for k in range(order + 1)]
        plant.set({"e": derivatives[0]})
        if order:
            plant.slave.setRealInputDerivatives([reference] * order, range(1, order + 1), derivatives[1:])
        plant.step(step)
        oscillator.step(step)
        worst = max(worst, abs(plant.get("q1") - oscillator.get("q1")))
    assert plant.get("impacts") == oscillator.get("impacts") > 10
    return worst / amplitude


def test_a_signal_given_as_polynomials_approaches_the_oscillator(instance, figure):
    errors = {}
    for samples, order in ((100, 1), (100, 3), (200, 3)):
        pair = instance("LoViNes"), instance("LoViNes")
        errors[samples, order] = polynomial_error(*pair, samples, order)
        what = f"e as polynomials of order {order}, {samples} samples a period: error of q1 over E"
        figure(what, errors[samples, order], below=1e-2 if order == 1 else 1e-5)
    # The error of a cubic goes with the fourth power of the step.
    figure("e as cubics: error at half the step over error", errors[200, 3] / errors[100, 3], between=(0, 1 / 8))
