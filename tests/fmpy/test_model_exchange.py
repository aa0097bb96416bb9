"""Model exchange against co-simulation: an independent integrator, the same physics."""

import numpy as np
import pytest
from fmpy import simulate_fmu

from bench import PERIOD, Scene
from references import trajectory

STATES = ("q1", "der(q1)", "q2", "der(q2)")
OUTPUTS = (*STATES, "v", "w", "base", "impacts", "contact", "dissipated")


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


def exchanged(fmus, start, stop, samples, tolerance):
    return simulate_fmu(
        str(fmus["LoViNes"].path),
        fmi_type="ModelExchange",
        solver="CVode",
        stop_time=stop,
        output_interval=stop / samples,
        relative_tolerance=tolerance,
        start_values=start,
        output=OUTPUTS,
        record_events=False,
    )


def stepped(instance, start, times):
    plant = instance("LoViNes").start(start)
    rows = []
    for time in times:
        if time > plant.time:
            plant.step(time - plant.time)
        rows.append(tuple(plant.get(name) for name in OUTPUTS))
    return np.array(rows, dtype=[(name, float) for name in OUTPUTS])


@pytest.mark.parametrize("scene", [lock, chatter], ids=lambda scene: scene.__name__)
def test_both_interfaces_agree_to_the_tolerance_of_the_integrator(fmus, instance, figure, scene):
    start, stop = scene()
    errors = []
    for tolerance, limit in ((1e-5, 2e-2), (1e-7, 3e-4), (1e-9, 1e-5), (1e-11, 2e-7)):
        exchange = exchanged(fmus, start, stop, 500, tolerance)
        steps = stepped(instance, start, exchange["time"])
        assert steps["impacts"][-1] > 10
        # Beside an impact a velocity of one run is from before it and of the other from after: displacements tell.
        errors.append(max(np.abs(exchange[name] - steps[name]).max() for name in ("q1", "q2", "v", "w", "base")))
        what = f"model exchange by CVode at tolerance {tolerance:g} against steps, {scene.__name__}: displacements"
        figure(what, errors[-1], below=limit)
    assert errors == sorted(errors, reverse=True)
    figure(
        f"dissipated energy at the end, {scene.__name__}",
        abs(exchange["dissipated"][-1] / steps["dissipated"][-1] - 1),
        below=1e-6,
    )
    if scene is lock:
        assert exchange["impacts"][-1] == steps["impacts"][-1]
    else:
        assert set(exchange["contact"]) <= {-1, 0, 1}
        assert np.any(exchange["contact"] != 0)
        figure(
            "share of samples in the same contact, chatter",
            (exchange["contact"] == steps["contact"]).mean(),
            between=(0.99, 1),
        )
