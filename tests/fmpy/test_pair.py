"""The pair coupled sample by sample: lock, release, decay, and the backbone that comes out of it."""

from math import pi

import numpy as np
import pytest

from coupling import HOLD_PERIODS, SAMPLE_TIME, Scene
from identification import decay
from references import stable_orbit
from theory import backbone

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
COMPARED_ABOVE = 0.2


@pytest.fixture(params=SCENES)
def scene(request):
    return request.param, SCENES[request.param]


@pytest.fixture(params=MASTERS)
def master(request):
    return request.param, MASTERS[request.param]


def rms_error(record):
    """RMS of the identified sigma less theory over the decay above C = 0.2."""
    amplitude, omega = decay(record.decay, record.step, record.locked().omega)
    above = amplitude > COMPARED_ABOVE
    error = record.scene.sigma(omega[above]) - backbone(amplitude[above], record.scene.r)
    return float(np.sqrt(np.mean(error**2)))


def check_lock(figure, name, record):
    """The lock against the exact orbit."""
    scene, locked = record.scene, record.locked()
    exact = stable_orbit(scene.epsilon, scene.r, scene.excitation)
    figure(f"{name}: lock, sigma off the exact orbit", abs(scene.sigma(locked.omega) - exact["sigma"]), below=5e-3)
    figure(f"{name}: lock, C off the exact orbit, relative", abs(locked.amplitude / exact["C"] - 1), below=5e-3)
    speed = np.abs(record.hold["particle"]).mean()
    figure(f"{name}: lock, B off the exact orbit, relative", abs(speed / exact["B"] - 1), below=5e-3)


def test_the_lock_is_the_exact_orbit(run, figure, scene):
    name, scene = scene
    check_lock(figure, name, run(scene))


def test_the_lock_is_at_phase_resonance_and_at_the_excitation_wanted(run, figure):
    record = run(Scene())
    response, base = record.locked(), record.base()
    lag = np.degrees(np.angle(np.exp(1j * (base.phase - response.phase))))
    figure("default: lag of v behind the base less 90, degrees", abs(lag - 90), below=0.3)
    figure("default: base amplitude off E, relative", abs(base.amplitude / record.scene.amplitude - 1), below=1e-6)


def test_the_regime_is_symmetric_with_two_impacts_per_period(run, figure, scene):
    name, scene = scene
    regime = run(scene).regime()
    figure(f"{name}: impacts per period at the lock", regime.per_period, between=(1.99, 2.01))
    figure(f"{name}: spread of the intervals, relative", regime.spread, below=1e-2)
    assert regime.alternating


def test_the_hold_lasts_and_then_the_drive_is_off(run):
    record = run(Scene())
    assert len(record.hold) == 100 * HOLD_PERIODS
    assert np.all(record.hold["E"] == record.scene.amplitude)
    assert record.hold["settled"][1:].all()
    assert np.all(record.decay["base"] == 0)
    assert len(record.rows) - record.released - len(record.decay) <= 2, (
        "the drive goes with the sample that asks for it"
    )


def test_the_backbone_along_the_decay_is_that_of_the_theory(run, figure):
    figure("default: RMS of sigma less theory over C > 0.2", rms_error(run(Scene())), below=0.08)


def test_the_distance_from_the_theory_halves_with_epsilon(run, figure):
    half = rms_error(run(SCENES["half epsilon"]))
    figure("half epsilon: RMS of sigma less theory over C > 0.2", half, below=0.08)
    figure("RMS at half epsilon over RMS at the default", half / rms_error(run(Scene())), between=(0.4, 0.6))


def test_the_lock_does_not_depend_on_how_the_master_couples(run, figure, master):
    name, options = master
    record = run(Scene(), **options)
    check_lock(figure, name, record)
    assert record.regime().symmetric


def test_from_rest_nothing_hits_and_the_linear_mode_is_locked(run, figure):
    record = run(Scene(particle_velocity=0))
    scene, locked, regime = record.scene, record.locked(), record.regime()
    # Exact for v = q1 under a base that moves spring and damper: Omega^2 = 1/(1 - (eps lambda)^2).
    exact = scene.sigma(1 / np.sqrt(1 - (scene.epsilon * scene.damping) ** 2))
    figure("from rest: sigma off the linear mode", abs(scene.sigma(locked.omega) - exact), below=5e-3)
    figure("from rest: C over G/lambda", locked.amplitude * scene.damping / scene.excitation, between=(0.995, 1.005))
    figure("from rest: impacts per period", regime.per_period, between=(0, 0))
    assert not regime.symmetric, "the controller calls it locked; only the impacts tell"
