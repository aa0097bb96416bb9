"""Sweeps from Python: the bytes of `vines sweep`, interruptions, and a local cluster of Dask."""

import errno
import json
import os
import signal
import subprocess
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import dask
import dask.threaded
import numpy as np
import pytest
import xarray
from dask.distributed import Client, LocalCluster

import vines

AXES = {"sigma": vines.linspace(-3.0, 3.0, 31), "start.dq2": vines.linspace(-0.6, 0.7, 40)}
SETTINGS = {"periods": 200, "chunk": 40}


def content(folder):
    return {str(one.relative_to(folder)): one.read_bytes() for one in Path(folder).rglob("*") if one.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("whole") / "store"
    vines.sweep(None, AXES, out=out, **SETTINGS)
    return content(out)


def test_the_store_has_the_bytes_of_the_program(whole, tmp_path):
    program = os.environ["VINES"]
    axes = [f"--axis={name}={one.first}:{one.last}:{one.number}" for name, one in AXES.items()]
    out = tmp_path / "store"
    subprocess.run([program, "sweep", *axes, "--periods=200", "--chunk=40", f"--out={out}"], check=True)
    assert content(out) == whole


def test_designs_lists_and_results_become_a_dataset_with_units(tmp_path):
    axes = {"plant.r": [0.5, 0.65], "start.dq2": ("random", -0.6, 0.6), "start.q2": ("random", -0.005, 0.005)}
    cells = vines.sweep(None, axes, out=tmp_path / "s", samples=8, periods=200, results=["response", "orbits"])
    assert dict(cells.sizes) == {"plant.r": 2, "sample": 8}
    assert cells["start.dq2"].dims == ("sample",)
    assert "start.dq2" in cells.coords
    assert cells["start.dq2"].attrs["units"] == "m/s"
    assert cells.impact_power.attrs["units"] == "W"
    assert (cells.failure == "").all()
    assert json.loads(cells.attrs["vines"])["scene"]["plant"]["M"] == 3.807


def test_paired_samples_share_a_dimension_and_have_the_cells_of_the_program(tmp_path):
    r, start = [0.5, 0.65, 0.5], np.array([0.3, 0.4, 0.5])
    cells = vines.sweep(None, paired={"plant.r": r, "start.dq2": start}, out=tmp_path / "s", periods=200)
    assert dict(cells.sizes) == {"sample": 3}
    assert cells["plant.r"].values.tolist() == r
    assert cells["start.dq2"].values.tolist() == start.tolist()
    grid = vines.sweep(None, {"plant.r": [0.5, 0.65], "start.dq2": start}, out=tmp_path / "grid", periods=200)
    for name in ("regime", "followed", "recurrence"):
        expected = [grid[name].values[0, 0], grid[name].values[1, 1], grid[name].values[0, 2]]
        assert np.array_equal(cells[name].values, expected, equal_nan=True)
    axes = ["--axis=plant.r=paired:0.5,0.65,0.5", "--axis=start.dq2=paired:0.3,0.4,0.5"]
    out = tmp_path / "program"
    subprocess.run([os.environ["VINES"], "sweep", *axes, "--periods=200", f"--out={out}"], check=True)
    assert content(out) == content(tmp_path / "s")


@pytest.mark.parametrize(
    ("axes", "paired", "parts"),
    [
        ({}, {"plant.r": [0.5, 0.6], "plant.b": [0.01, 0.02, 0.03]}, ["plant.r has 2", "plant.b has 3"]),
        ({"plant.r": [0.5, 0.6]}, {"plant.r": [0.5, 0.6]}, ["plant.r", "give one of them"]),
        ({}, {"plant.r": [0.5]}, ["one value"]),
    ],
)
def test_paired_samples_that_do_not_belong_together_are_value_errors(axes, paired, parts, tmp_path):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        vines.sweep(None, axes, paired=paired, out=tmp_path / "store")
    for part in parts:
        assert part in str(error.value)
    assert not (tmp_path / "store").exists()


def test_a_list_of_three_numbers_is_three_values(tmp_path):
    for n, values in enumerate(([0.3, 0.6, 0.9], np.array([0.3, 0.6, 0.9]), xarray.DataArray([0.3, 0.6, 0.9]))):
        cells = vines.sweep(None, {"plant.r": values}, out=tmp_path / str(n), periods=200)
        assert cells["plant.r"].values.tolist() == [0.3, 0.6, 0.9]


def test_codes_of_regimes_have_names_and_a_store_can_be_written_as_netcdf(tmp_path):
    cells = vines.sweep(None, {"plant.r": [0.5, 0.65]}, out=tmp_path / "s", sigma=-1.1, periods=1000)
    for r, code in zip([0.5, 0.65], cells.regime.values, strict=True):
        scene = vines.Scene(plant={"r": r})
        assert vines.REGIMES[code] == vines.regime(scene, sigma=-1.1, periods=1000).regime
    meanings = "_".join([*vines.REGIMES, "failed", "not_computed"]).replace(" ", "_")
    assert cells.regime.attrs["flag_meanings"].replace(" ", "_") == meanings
    allowed = (str, int, float, np.number, np.ndarray, list)
    for one in (cells, *cells.variables.values()):
        assert all(isinstance(value, allowed) and not isinstance(value, bool) for value in one.attrs.values())


@pytest.mark.parametrize(
    ("axes", "parts"),
    [
        ({"plant.rr": vines.linspace(0.3, 0.5, 3)}, ["plant.rr", "unknown field"]),
        ({"plant.r": vines.linspace(0.3, float("nan"), 3)}, ["plant.r", "NaN"]),
        ({"plant.r": [0.5]}, ["plant.r has one value", 'Scene(plant={"r": 0.5})']),
        ({"plant.r": 0.5}, ["plant.r = 0.5", "a list of numbers"]),
        ({"plant.r": ("normal", 0.3, 0.5)}, ["plant.r", "normal", "random"]),
        (
            {"plant.r": vines.linspace(0.3, 1.0, 10**6), "sigma": vines.linspace(-5.0, 5.0, 10**6)},
            ["1000000000000 cells", " h ", "GB", "confirm=True"],
        ),
        ({}, ["at least one axis"]),
        # A range until now, three values for everyone else.
        ({"plant.r": (0.3, 0.9, 7)}, ["plant.r = (0.3, 0.9, 7)", "vines.linspace", "a list"]),
        ({"plant.r": (0.3, 0.9)}, ["plant.r = (0.3, 0.9)", "vines.linspace", "a list"]),
        ({"plant.r": np.ma.masked_array([0.3, 0.5, 0.9], [0, 1, 0])}, ["masked"]),
        ({"plant.r": [[0.3, 0.5]]}, ["plant.r = [[0.3, 0.5]]", "a list of numbers"]),
        ({"plant.r": ["0.3", "0.5"]}, ["plant.r", "a list of numbers"]),
    ],
)
def test_bad_axes_are_value_errors_and_write_nothing(axes, parts, tmp_path):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        vines.sweep(None, axes, out=tmp_path / "store")
    for part in parts:
        assert part in str(error.value)
    assert not (tmp_path / "store").exists()


@pytest.mark.parametrize(
    ("setting", "parts"),
    [
        ({"periods": -1}, ["periods = -1", "from 0"]),
        ({"chunk": 0}, ["0 cells", "from 1 to 1000000"]),
        ({"seed": 2**64}, ["seed = 18446744073709551616", "2^64 - 1"]),
        ({"samples": 5}, ["random axis"]),
        ({"results": "locks"}, ["`locks`", "regime, response, orbits and lock"]),
        ({"sigma": float("inf")}, ["sigma = inf", "finite"]),
    ],
)
def test_bad_settings_are_value_errors_and_write_nothing(setting, parts, tmp_path):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        vines.sweep(None, {"plant.r": [0.5, 0.6]}, out=tmp_path / "store", **setting)
    for part in parts:
        assert part in str(error.value)
    assert not (tmp_path / "store").exists()


def test_a_store_of_another_sweep_stays_and_a_folder_that_cannot_be_written_is_an_os_error(tmp_path):
    out = tmp_path / "store"
    vines.sweep(None, {"plant.r": [0.5, 0.6]}, out=out, periods=200)
    before = content(out)
    with pytest.raises(ValueError, match="another `axes`"):
        vines.sweep(None, {"plant.r": [0.5, 0.7]}, out=out, periods=200)
    assert content(out) == before
    with pytest.raises(OSError, match="/proc/store") as error:
        vines.sweep(None, {"plant.r": [0.5, 0.6]}, out="/proc/store", periods=200)
    assert error.value.errno == errno.ENOENT


def test_damaged_chunks_are_computed_again_with_a_warning(whole, tmp_path):
    out = tmp_path / "store"
    vines.sweep(None, AXES, out=out, **SETTINGS)
    chunk = out / "impacts" / "c" / "3" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-4])
    (out / "settling" / "c" / "5" / "0").unlink()
    with pytest.warns(RuntimeWarning, match=r"2 damaged .*impacts/c/3/0 is truncated; .*settling/c/5/0 is missing"):
        vines.sweep(None, AXES, out=out, **SETTINGS)
    assert content(out) == whole


def test_cells_that_are_not_computed_are_recognised_in_xarray(tmp_path):
    out = tmp_path / "store"
    arguments = ["--axis=plant.r=0.3:0.9:4", "--periods=100", "--chunk=1", "--shard=1/2", f"--out={out}"]
    subprocess.run([os.environ["VINES"], "sweep", *arguments], check=True)
    cells = xarray.open_zarr(out).load()
    absent = [False, True, False, True]
    assert (cells.regime == 255).values.tolist() == absent
    assert (cells.failure == "not computed").values.tolist() == absent
    assert (cells.failure == "").values.tolist() == [not one for one in absent]
    for name, variable in cells.data_vars.items():
        if name not in ("regime", "failure"):
            assert variable.isnull().values[absent].all(), name
    for name in ["followed", "impacts", "periods", "settling", "synchrony"]:
        assert cells[name].isnull().values.tolist() == absent, name
    meanings = dict(zip(cells.regime.attrs["flag_values"], cells.regime.attrs["flag_meanings"].split(), strict=True))
    assert meanings[255] == "not_computed"
    assert meanings[254] == "failed"


@contextmanager
def after_the_first_chunk(out, action):
    """Something that happens in another thread as soon as the store has a chunk."""

    def wait():
        while not (out / "failure" / "c").exists():
            time.sleep(0.002)
        action()

    thread = threading.Thread(target=wait)
    thread.start()
    yield
    thread.join()


def test_ctrl_c_keeps_complete_chunks(tmp_path):
    sent = []

    def interrupt():
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    # Minutes of work: it is certainly interrupted.
    axes = AXES | {"sigma": vines.linspace(-3.0, 3.0, 30_001)}
    out = tmp_path / "store"
    with after_the_first_chunk(out, interrupt), pytest.raises(KeyboardInterrupt):
        vines.sweep(None, axes, out=out, **SETTINGS)
    print(f"{time.monotonic() - sent[0]:.3f} s")
    assert 0 < sum(name.startswith("failure/c/") for name in content(out)) < 30_001


def test_nothing_is_printed_and_a_bar_on_request(tmp_path, capfd):
    vines.sweep(None, {"plant.r": [0.5, 0.6]}, out=tmp_path / "quiet", periods=200)
    assert capfd.readouterr() == ("", "")
    vines.sweep(None, {"plant.r": [0.5, 0.6]}, out=tmp_path / "bar", periods=200, progress=True)
    assert "2/2" in capfd.readouterr().err


def cluster(workers, threads=1):
    return LocalCluster(n_workers=workers, threads_per_worker=threads, dashboard_address=None)


def test_workers_that_come_later_and_have_many_threads_give_the_same_bytes(whole, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with cluster(0, threads=4) as local, Client(local) as client:
        # As with a queueing system, whose workers start when it has room for them.
        threading.Timer(0.2, local.scale, (2,)).start()
        vines.sweep(None, AXES, out="store", client=client, **SETTINGS)
    assert content(tmp_path / "store") == whole


@pytest.mark.parametrize("scheduler", ["threads", "synchronous", dask.threaded.get])
def test_other_schedulers_of_dask_give_the_same_bytes(scheduler, whole, tmp_path):
    vines.sweep(None, AXES, out=tmp_path / "store", client=scheduler, **SETTINGS)
    assert content(tmp_path / "store") == whole


def test_a_worker_that_does_not_see_the_store_says_so(tmp_path):
    arguments = (vines.Scene(), {"plant.r": [0.5, 0.6]}, {}, str(tmp_path / "elsewhere"))
    with pytest.raises(OSError, match="elsewhere: this worker does not see the store"):
        vines.sweeps._chunk(0, 1, *arguments)
    assert not (tmp_path / "elsewhere").exists()


def test_with_dask_a_worker_is_killed_and_one_added_and_the_bytes_are_the_same(whole, tmp_path):
    out = tmp_path / "store"
    with cluster(2) as local, Client(local) as client:
        identity = client.run(os.getpid)

        def disturb():
            os.kill(next(iter(identity.values())), signal.SIGKILL)
            local.scale(3)

        with after_the_first_chunk(out, disturb):
            vines.sweep(None, AXES, out=out, client=client, **SETTINGS)
    assert content(out) == whole


def test_after_the_scheduler_ends_another_one_goes_on(tmp_path):
    # More work than what fits into the time in which a scheduler ends.
    settings = {"periods": 5000, "chunk": 40}
    out, whole = tmp_path / "store", tmp_path / "whole"
    with (
        cluster(1) as local,
        Client(local) as client,
        after_the_first_chunk(out, local.close),
        pytest.raises(Exception),  # noqa: B017, PT011  whatever the client notices first
    ):
        vines.sweep(None, AXES, out=out, client=client, **settings)
    with cluster(1) as local, Client(local) as client:
        vines.sweep(None, AXES, out=out, client=client, **settings)
    vines.sweep(None, AXES, out=whole, **settings)
    assert content(out) == content(whole)


def test_an_adaptive_map_marks_what_it_infers(tmp_path):
    axes = {"sigma": vines.linspace(-1.6, -0.9, 33), "excitation.G": vines.linspace(0.8, 1.3, 33)}
    cells = vines.sweep(None, axes, out=tmp_path / "store", periods=200, adaptive=8)
    assert 0 < int(cells.inferred.sum()) < cells.regime.size
    with pytest.raises(ValueError, match="one process"):
        vines.sweep(None, axes, out=tmp_path / "other", adaptive=8, client=object())
