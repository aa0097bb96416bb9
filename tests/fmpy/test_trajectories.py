"""The plant alone against trajectories computed in 40-digit arithmetic."""

import pytest

from coupling import Scene
from references import trajectory

STATES = ("q1", "der(q1)", "q2", "der(q2)")


@pytest.mark.parametrize("scene", ["lock", "resonance", "chatter"])
def test_every_state_after_every_step_is_within_1e_11_of_the_reference(instance, figure, scene):
    reference = trajectory(scene)
    epsilon, excitation = float(reference["eps"]), float(reference["G"])
    rig = Scene(epsilon, float(reference["r"]), excitation, 0, float(reference["lam"])).plant()
    plant = instance("LoViNes")
    start = dict(zip(STATES, map(float, reference["x0"]), strict=True))
    drive = {"omega": float(reference["Om"]), "E": epsilon * excitation}
    plant.start(rig | start | drive)
    states, counters = plant.group(*STATES), plant.group("impacts", "contact")
    worst = 0.0
    for row in reference["rows"]:
        plant.step(float(reference["step"]))
        worst = max(worst, *(abs(got - float(want)) for got, want in zip(states.get(), row[1:5], strict=True)))
        impacts, contact = counters.get()
        assert contact == row[6]
        # How many impacts a chatter holds depends on where counting stops.
        assert scene == "chatter" or impacts == row[5]
    figure(f"trajectory {scene}: worst error of any state", worst, below=1e-11)
