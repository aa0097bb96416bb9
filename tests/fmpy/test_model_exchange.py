"""Model exchange against co-simulation: an independent integrator, the same physics."""

import re

import numpy as np
import pytest
from fmpy import simulate_fmu

from coupling import PERIOD, Scene
from references import trajectory

STATES = ("q1", "der(q1)", "q2", "der(q2)")
OUTPUTS = (*STATES, "v", "w", "base", "impacts", "contact", "dissipated")
LOSSES = ("sticks", "stuck_time", "friction_loss")


def lock() -> tuple[dict[str, float], float]:
    """From near the locked orbit: two impacts in every period."""
    locked = {"q1": -0.42, "der(q1)": 0.01, "q2": -0.99, "der(q2)": -0.86}
    return Scene().plant() | locked | {"E": Scene().amplitude, "omega": 0.990417}, 10 * PERIOD


def chatter() -> tuple[dict[str, float], float]:
    """Chatter into sticking and out of it again: the reference scene."""
    scene = trajectory("chatter")
    epsilon, excitation = float(scene["eps"]), float(scene["G"])
    rig = Scene(epsilon, float(scene["r"]), excitation, 0, float(scene["lam"])).plant()
    start = dict(zip(STATES, map(float, scene["x0"]), strict=True))
    stop = float(scene["step"]) * len(scene["rows"])
    return rig | start | {"omega": float(scene["Om"]), "E": epsilon * excitation}, stop


def rough() -> tuple[dict[str, float], float]:
    """Friction, tilt, unequal gaps and a restitution that depends on speed, wall and chance."""
    cavity = {"b_plus": 1.1, "b_minus": 0.9, "theta": 2e-4, "mu_k": 2e-4, "mu_s": 3e-4, "r_scatter": 0.05, "seed": 7}
    laws = {"r_law": 1, "r_plus": 0.4, "r_minus": 0.3, "r_min": 0.1}
    start, stop = lock()
    return start | cavity | laws, stop


def sliding() -> tuple[dict[str, float], float]:
    """Stick and slip without impacts."""
    cavity = {"theta": 1e-3, "mu_k": 0.01, "mu_s": 0.012}
    start = {"c": 0.1, "q1": 0.0, "q2": 0.0, "der(q2)": 0.0, "E": 0.3, "omega": 0.5}
    return Scene().plant() | cavity | start, 10 * PERIOD


def exchanged(fmus, start, stop, samples, tolerance):
    return simulate_fmu(
        str(fmus["LoViNes"].path),
        fmi_type="ModelExchange",
        solver="CVode",
        stop_time=stop,
        output_interval=stop / samples,
        relative_tolerance=tolerance,
        start_values=start,
        output=[*OUTPUTS, *LOSSES],
        record_events=False,
    )


def stepped(instance, start, times):
    names = (*OUTPUTS, *LOSSES)
    plant = instance("LoViNes").start(start)
    rows = []
    for time in times:
        if time > plant.time:
            plant.step(time - plant.time)
        rows.append(tuple(plant.get(name) for name in names))
    return np.array(rows, dtype=[(name, float) for name in names])


@pytest.mark.parametrize("scene", [lock, chatter, rough, sliding], ids=lambda scene: scene.__name__)
def test_both_interfaces_agree_to_the_tolerance_of_the_integrator(fmus, instance, figure, scene):
    start, stop = scene()
    errors = []
    for tolerance, limit in ((1e-5, 2e-2), (1e-7, 3e-4), (1e-9, 1e-5), (1e-11, 2e-7)):
        exchange = exchanged(fmus, start, stop, 500, tolerance)
        steps = stepped(instance, start, exchange["time"])
        assert (steps["impacts"][-1] > 10) != (scene is sliding)
        # Beside an impact a velocity of one run is from before it and of the other from after: displacements tell.
        errors.append(max(np.abs(exchange[name] - steps[name]).max() for name in ("q1", "q2", "v", "w", "base")))
        what = f"model exchange by CVode at tolerance {tolerance:g} against steps, {scene.__name__}: displacements"
        figure(what, errors[-1], below=limit)
    assert errors == sorted(errors, reverse=True)
    for name in ("dissipated", "friction_loss", "stuck_time"):
        end = steps[name][-1]
        error = abs(exchange[name][-1] - end)
        figure(f"{name} at the end, {scene.__name__}", error / end if end > 0 else error, below=1e-6)
    if scene is chatter:
        assert set(exchange["contact"]) <= {-1, 0, 1}
        assert np.any(exchange["contact"] != 0)
        figure(
            "share of samples in the same contact, chatter",
            (exchange["contact"] == steps["contact"]).mean(),
            between=(0.99, 1),
        )
    else:
        assert exchange["impacts"][-1] == steps["impacts"][-1]
        assert exchange["sticks"][-1] == steps["sticks"][-1]
        assert (steps["friction_loss"][-1] > 0) == (scene is not lock)
        assert (steps["sticks"][-1] > 5) == (scene is sliding)


# Hard impacts from five half-widths away; and low hops on a wall that presses, which end in contact at any r.
CHATTERS = [{"q1": 0.05, "q2": 0.05, "der(q2)": 0.0}, {"q1": -0.05, "q2": -0.0599, "der(q2)": 0.05}]


@pytest.mark.parametrize("start", CHATTERS, ids=["impacts", "hops"])
@pytest.mark.parametrize("r", [0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.75, 0.9])
def test_every_event_of_a_chatter_is_an_impact_or_its_end_at_any_tolerance(fmus, figure, r, start):
    half_width, rests, highest = 0.01, 0, 0.0
    for tolerance in np.logspace(-3, -10, 8):
        log, points = [], []

        def step_finished(time, _, points=points):
            points.append(time)
            return len(points) < 2000

        result = simulate_fmu(
            str(fmus["LoViNes"].path),
            fmi_type="ModelExchange",
            stop_time=1.0,
            output_interval=0.01,
            relative_tolerance=tolerance,
            start_values=start | {"r": r, "E": 1e-4, "omega": 55.0},
            output=["dissipated"],
            logger=lambda _environment, _name, _status, _category, message, log=log: log.append(message.decode()),
            debug_logging=True,
            step_finished=step_finished,
        )
        assert result["time"][-1] == pytest.approx(1.0), "time has stopped"
        # FMPy records an event twice, and every other point once.
        events = len(result) - 1 - len(points)
        kinds = ("impact on", "came to rest", "released")
        effects = {kind: sum(kind in message for message in log) for kind in kinds}
        assert events <= sum(effects.values()), f"{tolerance}: {events} events, {effects}"
        left_out = [
            re.search(r"at most (\S+) m, .* their (\S+) J", message) for message in log if "came to rest" in message
        ]
        rests += len(left_out)
        highest = max(highest, *(float(one[1]) / half_width / tolerance for one in left_out), 0.0)
        assert 0 <= sum(float(one[2]) for one in left_out) < 1e-3 * result["dissipated"][-1]
    figure(f"highest hop left out at r = {r}, in tolerances of CVode times b", highest, below=5)
    assert rests > 0 or start == CHATTERS[0]
