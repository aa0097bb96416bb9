"""Plants, batches, scenes and experiments: bits, errors, threads and signals."""

import copy
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from decimal import Decimal
from fractions import Fraction
from functools import partial
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import xarray
from fmpy import extract, instantiate_fmu, read_model_description

import vines

DRIVE = {"amplitude": 9.2e-5, "omega": 54.9}


OUTPUTS = {"q1": "q1", "der(q1)": "dq1", "q2": "q2", "der(q2)": "dq2", "v": "v", "w": "w", "phase": "phase"}
"""Outputs of the plant's FMU, and the attributes of a plant."""


def fmu_outputs(start, steps, duration, integers=()):
    """Outputs of the plant's FMU after each of the steps."""
    path = vines.fmu("LoViNes")
    folder, description = extract(path), read_model_description(path)
    numbers = {one.name: one.valueReference for one in description.modelVariables}
    fmu = instantiate_fmu(folder, description, "CoSimulation")
    fmu.setupExperiment(startTime=0.0)
    values = start | {"E": DRIVE["amplitude"], "omega": DRIVE["omega"]}
    fmu.setReal([numbers[name] for name in values], list(values.values()))
    for name in integers:
        fmu.setInteger([numbers[name]], [integers[name]])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    rows = []
    for n in range(steps):
        fmu.doStep(n * duration, duration)
        rows.append(fmu.getReal([numbers[name] for name in OUTPUTS]))
    fmu.terminate()
    fmu.freeInstance()
    return rows


def attributes(plant, steps, duration):
    """The same outputs of a plant of the package."""
    rows = []
    for _ in range(steps):
        plant.advance(duration, **DRIVE)
        rows.append([getattr(plant, name) for name in OUTPUTS.values()])
    return rows


def test_the_attributes_of_a_plant_have_the_bits_of_the_outputs_of_the_fmu():
    plant = vines.Plant(vines.Scene(), dq2=0.5)
    start = vines.Scene().settings["plant"] | {"der(q2)": 0.5}
    assert attributes(plant, 4096, 1.0 / 1024) == fmu_outputs(start, 4096, 1.0 / 1024)
    assert plant.impacts > 40
    assert list(plant.state.values()) == [getattr(plant, name) for name in plant.state]
    assert abs(plant.base - DRIVE["amplitude"] * np.sin(plant.phase)) < 1e-18


def test_a_batch_has_the_bits_of_its_plants_and_all_their_events():
    scene, random = vines.Scene(), np.random.default_rng(4)
    starts, restitution = random.uniform(-0.6, 0.6, 40), random.uniform(0.3, 0.9, 40)
    batch = vines.Batch(scene.settings["plant"] | {"r": restitution}, {"dq2": starts})
    durations = random.uniform(0.5, 3.0, 40)
    events = batch.advance(durations, **DRIVE)
    for n in range(40):
        plant = vines.Plant(scene.settings["plant"] | {"r": restitution[n]}, dq2=starts[n])
        own = plant.advance(durations[n], **DRIVE)
        mine = events.plant == n
        assert np.array_equal(batch.states[n], plant.states[0])
        assert np.array_equal(events.time[mine], own.time)
        assert np.array_equal(events.velocity[mine], own.velocity, equal_nan=True)
    assert (events.kind == 0).sum() == batch.impacts.sum() > 500
    data = batch.to_xarray()
    assert data.q1.attrs["units"] == "m"
    assert events.to_xarray().velocity.attrs["units"] == "m/s"


def test_a_state_that_is_set_is_that_of_a_start_and_a_refused_one_changes_nothing():
    plant = vines.Plant()
    plant.advance(1.0, **DRIVE)
    start = {"q1": 0.001, "dq1": -0.02, "q2": -0.004, "dq2": 0.3}
    plant.state = start
    assert plant.state == start
    assert plant.time == 1.0
    plant.state = {"dq2": np.asarray(-0.3)}
    assert plant.state == start | {"dq2": -0.3}
    for wrong, parts in [
        ({"q2": 0.02}, ["w = q1 - q2", "-b_minus to b_plus"]),
        ({"q3": 0.0}, ["q3", "q1, dq1, q2, dq2"]),
        ({"q1": np.nan}, ["q1", "NaN"]),
    ]:
        with pytest.raises(ValueError) as error:  # noqa: PT011
            plant.state = wrong
        assert all(part in str(error.value) for part in parts)
        assert plant.state == start | {"dq2": -0.3}


def test_a_trajectory_has_the_bits_of_its_steps_and_all_their_events():
    one, other = vines.Plant(dq2=0.5), vines.Plant(dq2=0.5)
    motion = one.trajectory(2.0, 512, **DRIVE)
    times = []
    for n in range(512):
        times += other.advance(2.0 / 512, **DRIVE).time.tolist()
        assert [motion.q1[n + 1], motion.dq2[n + 1], motion.base[n + 1]] == [
            other.q1,
            other.dq2,
            pytest.approx(other.base, abs=1e-18),
        ]
    assert one == other
    assert motion.events.time.tolist() == times
    assert motion.to_xarray().q1.attrs["units"] == "m"
    with pytest.raises(ValueError, match="steps = 0"):
        one.trajectory(1.0, 0)
    with pytest.raises(ValueError, match="omega"):
        one.trajectory(1.0, 5, omega=np.nan)
    assert one == other


def memory():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_a_plant_of_a_batch_costs_less_than_1_kb():
    before, n = memory(), 200_000
    batch = vines.Batch(vines.Scene(), {"dq2": np.linspace(0.3, 0.6, n)})
    for _ in range(2):
        batch.advance(0.01, **DRIVE, events=False)
    assert (memory() - before) / n < 1000


ADVANCE_AND_SWEEP = """
import multiprocessing, sys, vines
def batch(n):
    plants = vines.Batch(vines.Scene(), {"dq2": [0.3, 0.4]})
    plants.advance(0.1, amplitude=9.2e-5, omega=54.9)
    return plants.states.tolist()
def sweep(n):
    return vines.sweep(None, {"plant.r": [0.5, 0.6]}, store=f"{sys.argv[1]}/{n}", periods=200).sizes["plant.r"]
def one(n):
    plant = vines.Plant()
    plant.advance(0.1)
    return plant.q1
works = [batch, sweep]
for before in works:
    with multiprocessing.get_context("fork").Pool(1) as pool:
        if before is works[0]:
            assert all(pool.apply(work, (10 + n,)) for n, work in enumerate(works))
    before(0)
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply(one, (0,)) == one(0)
        for after in works:
            try:
                pool.apply(after, (20,))
            except RuntimeError as error:
                assert "was forked from process" in str(error) and 'get_context("spawn")' in str(error)
            else:
                raise AssertionError("no error")
print("done")
"""


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork")
def test_a_fork_after_use_is_refused_with_the_way_out_and_one_before_it_computes(tmp_path):
    command = [sys.executable, "-W", "ignore", "-c", ADVANCE_AND_SWEEP, str(tmp_path)]
    # Instead of an error it would wait for ever.
    found = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert found.stdout == "done\n", found.stderr


NUMBERS = [
    1.5,
    np.asarray(1.5),
    np.float32(1.5),
    np.float16(1.5),
    np.longdouble(1.5),
    np.ma.array(1.5),
    xarray.DataArray(1.5),
    xarray.Variable((), 1.5),
    xarray.DataArray([1.0, 1.5])[1],
    Decimal("1.5"),
    Fraction(3, 2),
]


@pytest.mark.parametrize("number", NUMBERS, ids=lambda one: type(one).__name__)
def test_a_number_of_any_library_keeps_its_value_at_every_door(number):
    assert vines.Scene(excitation={"G": number}).dimensionless["G"] == pytest.approx(1.5, rel=1e-12)
    small = number / 1000 if not isinstance(number, Decimal) else number / Decimal(1000)
    if type(number).__name__ not in ("float16", "float32"):
        assert vines.Plant(q1=small).q1 == 0.0015
        assert vines.Batch(vines.Scene(), {"q1": small}).states[0, 0] == 0.0015
    for give in (
        lambda value: vines.Plant(dq2=value),
        lambda value: vines.Batch(vines.Scene(), {"dq2": [value, value]}),
    ):
        one, other = give(number), give(1.5)
        for plants, value in ((one, number), (other, 1.5)):
            plants.advance(value, amplitude=1e-4, omega=value)
        assert np.array_equal(one.states, other.states)
    assert vines.Scene().drive(sigma=number) == vines.Scene().drive(sigma=1.5)
    assert vines.orbits(sigma=number) == vines.orbits(sigma=1.5)
    assert vines.PhaseLock().sample(number, number) == vines.PhaseLock().sample(1.5, 1.5)
    one, other = (vines.sweep(None, {"excitation.G": [value]}, sigma=value, periods=100) for value in (number, 1.5))
    assert one.identical(other)


@pytest.mark.parametrize(
    "wrong",
    [
        np.ma.masked,
        np.ma.array(1.5, mask=True),
        np.complex128(1.5),
        np.asarray(1.5 + 0j),
        np.datetime64("2026-01-01", "ns"),
        np.array([1.5]),
        "x",
    ],
    ids=repr,
)
def test_what_is_no_number_is_refused_at_every_door(wrong):
    if not isinstance(wrong, str):
        with pytest.raises(ValueError, match=r"excitation\.G"):
            vines.Scene(excitation={"G": wrong})
    for door in (
        lambda: vines.Plant().advance(1.0, omega=wrong),
        lambda: vines.Plant().advance(wrong),
        lambda: vines.PhaseLock().sample(wrong),
        lambda: vines.orbits(sigma=wrong),
        lambda: vines.regime(sigma=wrong),
        lambda: vines.Scene().drive(sigma=wrong),
        lambda: vines.sweep(None, {"plant.r": [0.5]}, sigma=wrong, periods=100),
        lambda: vines.sweep(None, {"plant.r": [0.5, wrong]}, periods=100),
    ):
        with pytest.raises((TypeError, ValueError)):
            door()


def test_masked_arrays_are_refused():
    values = np.ma.masked_array([0.1, 0.2], [False, True])
    for wrong in (values, [0.1, np.ma.masked]):
        with pytest.raises(ValueError, match="masked"):
            vines.Batch(vines.Scene(), {"dq2": wrong})


def test_a_copy_continues_with_the_same_bits():
    one = vines.Plant()
    one.advance(1.0, **DRIVE)
    other = one.copy()
    one.advance(1.0, **DRIVE)
    other.advance(1.0, **DRIVE)
    assert one.state == other.state
    assert isinstance(other, vines.Plant)


@pytest.mark.parametrize("again", [lambda one: pickle.loads(pickle.dumps(one)), copy.copy, copy.deepcopy])
def test_what_was_pickled_or_copied_continues_with_the_same_bits(again):
    random = np.random.default_rng(31)
    batch = vines.Batch(vines.Scene(), {"dq2": random.uniform(0.0, 1.0, 20)})
    for duration in random.uniform(0.01, 2.0, 20):
        batch.advance(duration, **DRIVE)
    other = again(batch)
    assert isinstance(other, vines.Batch)
    found, expected = other.advance(3.0, **DRIVE), batch.advance(3.0, **DRIVE)
    assert np.array_equal(other.states, batch.states)
    assert np.array_equal(found.time, expected.time)
    assert np.array_equal(other.dissipated, batch.dissipated)
    assert isinstance(again(vines.Plant()), vines.Plant)

    lock, responses = vines.PhaseLock(), 1e-3 * np.sin(0.06 * np.arange(4000))
    for response in responses[:2000]:
        lock.sample(response)
    follower = again(lock)
    assert [lock.sample(one) for one in responses[2000:]] == [follower.sample(one) for one in responses[2000:]]


@pytest.mark.parametrize("one", [vines.Plant(), vines.PhaseLock()])
def test_bytes_of_another_version_and_damaged_ones_are_refused(one):
    saved, version = one.__getstate__(), b"0.1.0"
    assert saved.count(version) == 1
    for wrong, words in [
        (saved.replace(version, b"9.9.9"), "pickled with vines 9.9.9, and this is 0.1.0"),
        (saved[:-3], "not what vines 0.1.0 pickles"),
        (saved + b"abc", "3 bytes too many"),
        (b"", "not what vines 0.1.0 pickles"),
    ]:
        with pytest.raises(ValueError, match=words):
            one.__setstate__(wrong)


def test_plants_show_their_state():
    assert repr(vines.Plant(dq2=0.25)) == "<Plant at 0 s: q1 = 0, dq1 = 0, q2 = 0, dq2 = 0.25>"
    assert repr(vines.Batch(vines.Scene(), {"dq2": [0.1, 0.2]})) == "<Batch of 2 plants>"


@pytest.mark.parametrize(
    ("wrong", "parts"),
    [
        (
            lambda: vines.Plant({**vines.Scene().settings["plant"], "k": -1.0}),
            ["k (stiffness)", "-1", "N/m", "1e-100 to 1e100"],
        ),
        (lambda: vines.Plant(q2=0.02), ["0.02", "m", "-b_minus to b_plus"]),
        (lambda: vines.Plant(q3=0.0), ["q3", "q1, dq1, q2, dq2"]),
        (lambda: vines.Batch(vines.Scene(), {"dq2": [0.1, np.nan]}), ["plant 1", "NaN", "m/s"]),
        (lambda: vines.Plant().advance(1.0, amplitude=np.inf), ["E (amplitude", "inf", "m"]),
        (lambda: vines.Plant().advance(-1.0), ["-1"]),
        (lambda: vines.Batch(vines.Scene(), {"dq2": [0.1, 0.2], "q1": np.zeros(3)}), ["dq2 (2,)", "q1 (3,)"]),
        (lambda: vines.Batch({"M": 1.0}), ["k (N/m) is missing"]),
        (lambda: vines.Batch(vines.Scene(), {"dq2": [1j]}), ["dq2 of type complex128", "real numbers"]),
        (lambda: vines.Batch(vines.Scene(), {"dq2": "0.5"}), ["dq2 of type <U3", "real numbers"]),
        (lambda: vines.Batch(vines.Scene(), {"dq2": [None]}), ["dq2 of type object", "real numbers"]),
        (
            lambda: vines.Batch(vines.Scene(), {"dq2": [0.1, 0.2]}).advance([1.0, 2.0, 3.0]),
            ["duration of shape (3,)", "2 numbers"],
        ),
        (lambda: vines.Batch(vines.Scene(), {"dq2": 0.1}).advance(1.0, omega=[True]), ["omega of type bool"]),
        (lambda: vines.Scene().drive(sigma=-1e9), ["sigma = -1000000000", "above -118.9"]),
        (lambda: vines.identify(results="decay"), ["results = 'decay'", "lock"]),
        (lambda: vines.Plant(dq2=[0.1, 0.2]), ["2 plants", "Batch"]),
        (lambda: vines.Plant(dq2=[]), ["0 plants"]),
        (lambda: vines.Scene(plant={"rr": 1}), ["plant.rr", "unknown field"]),
        (lambda: vines.Scene(controller={"bandwidth": -3.0}), ["controller.bandwidth", "-3"]),
        (lambda: vines.Scene(plant={"r": None}), ["plant.r = None", "a number"]),
        (lambda: vines.Scene(plant={"r": np.array([0.7])}), ["plant.r = array([0.7])", "a number"]),
        (lambda: vines.regime(sigma=-1e9), ["sigma = -1000000000", "above -118.9"]),
        (lambda: vines.Scene(path="a", text="b"), ["give one"]),
        (lambda: vines.fmu("Other"), ["Other", "LoViNes", "PhaseLock"]),
        (lambda: vines.orbits(sigma=np.nan), ["sigma", "NaN"]),
        (lambda: vines.regime(periods=3), ["periods = 3", "100"]),
        (lambda: vines.regime(periods=-3), ["periods = -3", "100"]),
        (lambda: vines.theory(points=1), ["points = 1", "2 to 10000"]),
        (lambda: vines.theory(points=-1), ["points = -1", "2 to 10000"]),
    ],
)
def test_a_value_that_is_not_allowed_is_a_value_error_with_value_and_range(wrong, parts):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        wrong()
    for part in parts:
        assert part in str(error.value)
    # What the program's options say, means nothing here.
    assert "--" not in str(error.value)


def test_arrays_of_any_layout_and_type_of_real_numbers_give_the_same_bits():
    starts = np.linspace(-0.5, 0.5, 9, dtype=np.float32)
    expected = vines.Batch(vines.Scene(), {"dq2": starts.tolist()})
    expected.advance(1.0, **DRIVE)
    swapped = starts.astype(">f8")
    swapped.flags.writeable = False
    for given in (starts, np.repeat(starts, 3)[::3], starts[::-1].copy()[::-1], swapped):
        batch = vines.Batch(vines.Scene(), {"dq2": given})
        batch.advance(np.ones(18, dtype=np.int8)[::2], **DRIVE)
        assert np.array_equal(batch.states, expected.states)


def test_a_batch_that_does_not_fit_into_memory_is_a_memory_error():
    # No memory behind these rows: they are all the same.
    parameters = np.broadcast_to([3.807, 11680.0, 3.3, 0.032, 0.01, 0.65], (10**12, 6))
    with pytest.raises(MemoryError, match="1000000000000 plants need"):
        vines._native.Plants(parameters, np.broadcast_to(0.0, (10**12, 4)))


@pytest.mark.parametrize("function", [vines.identify, vines.backbone, vines.orbits, vines.theory, vines.regime])
def test_what_is_no_scene_is_a_type_error_that_names_the_way(function):
    with pytest.raises(TypeError, match=r"a Scene is allowed, for instance Scene\(plant="):
        function({"plant": {"r": 0.7}})


def test_a_lock_without_its_decay_is_that_of_the_whole_experiment():
    whole, lock = vines.identify(), vines.identify(results="lock")
    assert lock.lock["sigma"] == pytest.approx(whole.lock["sigma"], abs=1e-6)
    assert lock.exact == whole.exact
    assert len(lock.to_xarray().variables) == 0
    assert lock != whole


def test_results_compare_by_their_numbers_and_show_themselves_in_a_few_lines():
    for compute in (
        lambda: vines.theory(points=5),
        lambda: vines.regime(sigma=-1.1, periods=1000),
        lambda: vines.identify(results="lock"),
        lambda: vines.Plant(dq2=0.5).trajectory(1.0, 10, **DRIVE),
        lambda: vines.Plant(dq2=0.5).advance(1.0, **DRIVE),
        lambda: vines.orbits()[0],
        vines.Scene,
        vines.Plant,
        lambda: vines.Batch(vines.Scene(), {"dq2": [0.1, 0.2]}),
    ):
        one, other = compute(), compute()
        assert one == other
        assert one != "another type"
        assert len(repr(one)) < 700
        if isinstance(one, vines.results.Result):
            assert one._repr_html_().startswith(f"<table><caption>{type(one).__name__}")
    assert vines.theory(points=5) != vines.theory(points=6)
    assert vines.Plant() != vines.Plant(dq2=0.1)
    assert vines.Scene(plant={"r": 0.7}) != vines.Scene()


def test_results_draw_themselves():
    matplotlib.use("agg")
    backbone = vines.backbone(vines.Scene(backbone={"C_from": 0.6, "C_to": 0.5, "points": 2}))
    motion = vines.Plant(dq2=0.5).trajectory(1.0, 10, **DRIVE)
    for one in (vines.theory(points=5), vines.identify(), vines.identify(results="lock"), backbone, motion):
        assert one.plot().get_lines()
    assert motion.events.plot().get_xlabel() == "time, s"


def test_drives_are_converted_in_both_directions():
    scene = vines.Scene()
    n, drive = scene.dimensionless, scene.drive(sigma=-1.1)
    assert drive["amplitude"] == pytest.approx(n["epsilon"] * 1.1 * n["b"], rel=1e-15)
    assert drive["omega"] == pytest.approx(n["omega0"] * (1 - 1.1 * n["epsilon"]), rel=1e-15)
    assert scene.detuning(**scene.drive(sigma=2.0, G=0.3)) == pytest.approx({"sigma": 2.0, "G": 0.3}, rel=1e-12)
    assert scene.detuning(n["omega0"]) == {"sigma": 0.0}


def test_after_an_error_no_plant_has_advanced():
    batch = vines.Batch(vines.Scene(), {"dq2": [0.1, 0.2]})
    with pytest.raises(ValueError, match="plant 1"):
        batch.advance([1.0, np.nan], **DRIVE)
    assert batch.times.tolist() == [0.0, 0.0]


def test_an_experiment_without_a_lock_is_a_runtime_error():
    with pytest.raises(RuntimeError, match="lock"):
        vines.identify(vines.Scene(excitation={"G": 0.1}))


def test_results_become_datasets_with_units():
    assert vines.theory(points=5).to_xarray().sigma.attrs["units"] == "1"
    assert vines.regime(sigma=-1.1).to_xarray().exponent < 0
    decay = vines.identify().to_xarray()
    assert decay.sizes["point"] == 95
    assert decay.attrs["lock_regime_by_impacts"] == "symmetric 1:1"
    orbit = vines.orbits()[0].to_xarray()
    assert orbit.gamma.attrs["units"] == "rad"
    assert orbit.multipliers.sizes == {"multiplier": 4}
    tracked = vines.backbone(vines.Scene(backbone={"C_from": 0.6, "C_to": 0.5, "points": 2})).to_xarray()
    assert tracked.u_sigma.attrs["units"] == "1"
    assert tracked.phase_error_deg.attrs["units"] == "degree"


def interrupted(work):
    """Processor time from Ctrl-C to its exception, s: on a busy machine, too."""
    sent = []

    def interrupt():
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(0.3, interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        work()
    return time.process_time() - sent[0]


@pytest.mark.parametrize("omega", [1e-3, DRIVE["omega"], 1e6, 1e12])
@pytest.mark.parametrize("plants", [1, 2, 2000])
def test_ctrl_c_ends_plants_within_02_s_at_any_frequency_and_none_has_advanced(omega, plants):
    batch = vines.Batch(vines.Scene(), {"dq2": np.linspace(0.3, 0.6, plants)})
    # Ten million impacts per plant would take seconds.
    work = partial(batch.advance, 1e9, amplitude=DRIVE["amplitude"], omega=omega, events=False)
    assert interrupted(work) < 0.2 * os.cpu_count()
    assert batch.times.max() == 0.0


def test_ctrl_c_ends_the_search_for_a_regime_at_any_frequency():
    # A period of the base is as long as millions of the oscillator.
    scene = vines.Scene(excitation={"G": 1000.0})
    assert interrupted(lambda: vines.regime(scene, sigma=-118.96)) < 0.2 * os.cpu_count()


def test_ctrl_c_ends_every_long_calculation_whatever_it_does():
    plant = vines.StructurePlant(vines.Scene(Path(__file__).parents[2] / "scenes/cantilever.toml"))
    for work in [
        lambda: vines.identify(vines.Scene(record={"hold_periods": 150_000})),
        lambda: vines.backbone(vines.Scene(backbone={"points": 1000})),
        lambda: plant.trajectory(1e5, 3 * 10**6, amplitude=1e-4, omega=55.0),
    ]:
        interrupted(work)
    assert plant["time"] == 0.0


CAVITY = {
    "b_plus": 0.011, "b_minus": 0.009, "theta": 0.1, "mu_k": 0.2, "mu_s": 0.3, "r_plus": 0.7, "r_minus": 0.6,
    "r_min": 0.1, "r_scatter": 0.1, "seed": 3,
}  # fmt: skip


def test_a_real_cavity_has_the_bits_of_the_fmu_in_a_scene_a_plant_and_a_batch():
    scene = vines.Scene(plant=CAVITY)
    values = scene.settings["plant"]
    assert {name: values[name] for name in CAVITY} == CAVITY
    reals = {name: value for name, value in values.items() if name != "seed"}
    expected = fmu_outputs(reals | {"der(q2)": 0.5}, 512, 1.0 / 128, {"seed": 3})
    for plant in (vines.Plant(scene, dq2=0.5), vines.Plant(values, q1=0, dq1=0, q2=0, dq2=0.5)):
        assert attributes(plant, 512, 1.0 / 128) == expected
        assert plant.sticks > 0
        assert min(plant.stuck_time, plant.friction_loss) > 0
    batch = vines.Batch(values | {"mu_k": [0.2, 0.0], "mu_s": [0.3, 0.0]}, {"dq2": 0.5, "q1": 0, "dq1": 0, "q2": 0})
    events = batch.advance(1.0, **DRIVE)
    assert list(batch.sticks > 0) == list(batch.stuck_time > 0) == list(batch.friction_loss > 0) == [True, False]
    kinds = {vines.KINDS[kind] for kind in events.kind[events.plant == 0]}
    assert {"impact", "sticking", "slip"} <= kinds


def test_a_law_of_restitution_has_a_name_and_a_parameter():
    values = vines.Scene().settings["plant"] | {"r_law": "viscoelastic", "r_plus": 0.343}
    assert vines.Plant(vines.Scene(plant={"r_law": "viscoelastic", "r_plus": 0.343}), dq2=0.5) == vines.Plant(
        values, q1=0, dq1=0, q2=0, dq2=0.5
    )
    start = {"q1": 0, "dq1": 0, "q2": 0, "dq2": 0}
    for wrong, part in [
        ({"r_law": "rubber"}, "plastic"),
        ({"r_law": "plastic"}, "r_plus"),
        ({"mu_k": float("nan")}, "nan"),
        ({"mu_k": -1}, "0 to 100"),
        ({"seed": 0.5}, "whole"),
    ]:
        plain = vines.Scene().settings["plant"]
        with pytest.raises(ValueError, match=part):
            vines.Plant(plain | wrong, **start)
