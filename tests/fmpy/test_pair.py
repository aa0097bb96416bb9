"""The pair coupled sample by sample locks on the exact orbit."""

from math import pi

import numpy as np
import pytest

from coupling import SAMPLE_TIME, Scene
from references import stable_orbit

SCENES = {
    "default": Scene(),
    "half epsilon": Scene(epsilon=0.0042),
    "G = 1.3": Scene(excitation=1.3),
    "r = 0.8": Scene(r=0.8),
}
MASTERS = {
    "own oscillator as reference": {"reference": False},
    "steps of three samples": {"step": 3 * SAMPLE_TIME},
    "steps of half a sample": {"step": SAMPLE_TIME / 2},
    # Held samples lag by half a sample on average, a whole one as they are read at the end of a step.
    "samples of the drive": {"sampled": True, "settings": (("phase_target", SAMPLE_TIME / 2 - pi / 2),)},
    # One sample from controller to base, and half a sample that it is held.
    "samples of the drive, own oscillator": {
        "sampled": True,
        "reference": False,
        "settings": (("delay", 1.5 * SAMPLE_TIME),),
    },
}


def check_lock(figure, name, record):
    """The lock against the exact orbit."""
    scene, locked = record.scene, record.fundamental("v")
    exact = stable_orbit(scene.epsilon, scene.r, scene.excitation)
    figure(f"{name}: lock, sigma off the exact orbit", abs(scene.sigma(locked.omega) - exact["sigma"]), below=5e-3)
    figure(f"{name}: lock, C off the exact orbit, relative", abs(locked.amplitude / exact["C"] - 1), below=5e-3)
    speed = np.abs(record.rows["particle"]).mean()
    figure(f"{name}: lock, B off the exact orbit, relative", abs(speed / exact["B"] - 1), below=5e-3)
    figure(f"{name}: impacts per period", record.impacts_per_period(), between=(1.95, 2.05))


@pytest.mark.parametrize("name", SCENES)
def test_the_lock_is_the_exact_orbit(run, figure, name):
    check_lock(figure, name, run(SCENES[name]))


def test_the_lock_is_at_phase_resonance_and_at_the_excitation_wanted(run, figure):
    record = run(Scene())
    response, base = record.fundamental("v"), record.fundamental("base")
    lag = np.degrees(np.angle(np.exp(1j * (base.phase - response.phase))))
    figure("default: lag of v behind the base less 90, degrees", abs(lag - 90), below=0.3)
    figure("default: base amplitude off E, relative", abs(base.amplitude / record.scene.amplitude - 1), below=1e-6)


@pytest.mark.parametrize("name", MASTERS)
def test_the_lock_does_not_depend_on_how_the_master_couples(run, figure, name):
    check_lock(figure, name, run(Scene(), **MASTERS[name]))
