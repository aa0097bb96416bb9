"""Sweeps from Python: their cells, stores that are killed, damaged and continued, and a local cluster of Dask."""

import csv
import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import dask
import numpy as np
import pytest
import xarray
from dask.distributed import Client, LocalCluster

import vines

AXES = {"sigma": np.linspace(-3.0, 3.0, 31), "start.dq2": np.linspace(-0.6, 0.7, 40)}
SETTINGS = {"periods": 200, "chunks": {"sigma": 1}}


def files(folder):
    """Every file of a store but those that a killed process left under another name, with its content."""
    found = (file for file in Path(folder).rglob("*") if file.is_file() and file.suffix != ".partial")
    return {str(file.relative_to(folder)): file.read_bytes() for file in found}


def written(folder):
    """When every file was written."""
    return {name: (Path(folder) / name).stat().st_mtime_ns for name in files(folder)}


def chunks(names):
    """The chunks of the results among the names of files."""
    return {tuple(name.split("/")[2:]) for name in names if "/c/" in name and not name.startswith(tuple(AXES))}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("whole") / "store"
    vines.sweep(None, AXES, store=out, **SETTINGS)
    return files(out)


def test_in_memory_in_a_store_and_with_the_schedulers_of_dask_the_cells_are_identical(tmp_path):
    axes = {
        "sigma": np.linspace(-3.0, 3.0, 5),
        "plant.r": ("sample", [0.5, 0.6, 0.7]),
        "start.dq2": ("sample", [0.3] * 3),
    }
    settings = {"periods": 200, "results": ["response", "orbits"]}
    cells = vines.sweep(None, axes, **settings)
    assert dict(cells.sizes) == {"sigma": 5, "sample": 3}
    stored = vines.sweep(None, axes, store=tmp_path / "s", chunks={"sample": 2}, **settings)
    xarray.testing.assert_identical(stored.compute(), cells)
    lazy = vines.sweep(None, axes, chunks={"sigma": 2, "sample": 2}, **settings)
    assert dask.is_dask_collection(lazy)
    for scheduler in ("threads", "synchronous"):
        xarray.testing.assert_identical(lazy.compute(scheduler=scheduler), cells)
    with Client(processes=False, dashboard_address=None):
        lazy = vines.sweep(None, axes, **settings)
        assert dask.is_dask_collection(lazy)
        xarray.testing.assert_identical(lazy.compute(), cells)


def test_axes_are_coordinates_of_xarray_and_results_have_units():
    values = [0.3, 0.6, 0.9]
    for given in (values, np.array(values), xarray.DataArray(values), ("sample", values)):
        cells = vines.sweep(None, {"plant.r": given}, periods=200, results=["response"])
        assert cells["plant.r"].values.tolist() == values
    assert cells.impact_power.attrs["units"] == "W"
    units = {"sigma": "1", "plant.c": "N s/m", "chain.snr": "dB", "phase_lock.base_bandwidth": "rad/s"}
    for key, unit in units.items():
        assert vines.sweep(None, {key: [1.0]}, periods=200)[key].attrs["units"] == unit
    # Noise is in the unit of the sensor.
    forced = vines.Scene(resonance={"sensor": "q1", "sensor_quantity": "velocity", "reference": "force"})
    for key, unit in (("chain.response_noise", "m/s"), ("chain.reference_noise", "N")):
        assert vines.sweep(forced, {key: [1e-6]}, periods=200)[key].attrs["units"] == unit
    assert json.loads(cells.attrs["vines"])["scene"]["plant"]["M"] == 3.807
    allowed = (str, int, float, np.number, np.ndarray, list)
    for one in (cells, *cells.variables.values()):
        # As netCDF has them.
        assert all(isinstance(value, allowed) and not isinstance(value, bool) for value in one.attrs.values())


def test_cells_have_the_bits_of_the_map_and_of_the_program(tmp_path):
    options = "--x sigma=-3:3:7 --y G=0.4:2.4:6 --periods 400 --confirmations 0"
    subprocess.run(
        [os.environ["VINES"], "map", *options.split(), "--out", tmp_path], check=True, stdout=subprocess.DEVNULL
    )
    with (tmp_path / "map.csv").open() as table:
        rows = list(csv.DictReader(table))
    axes = {"excitation.G": 0.4 + np.arange(6) * (2.0 / 5), "sigma": -3.0 + np.arange(7) * 1.0}
    cells = vines.sweep(None, axes, periods=400)
    assert [vines.REGIMES[code] for code in cells.regime.values.flat] == [row["regime"] for row in rows]
    for name, column in (("settling", "transient"), ("exponent", "exponent"), ("recurrence", "recurrence")):
        expected = [float(row[column] or "nan") for row in rows]
        assert np.array_equal(cells[name].values.ravel(), expected, equal_nan=True), name


def test_on_a_symmetric_motion_the_response_is_that_of_the_exact_orbit():
    axes = {"sigma": [-1.2, -1.05], "excitation.G": [1.05, 1.15, 1.25]}
    cells = vines.sweep(None, axes, results=["response", "orbits"])
    assert abs(cells.C / cells.orbit_C - 1).max() < 1e-5
    numbers = vines.Scene().dimensionless
    # The relative velocity of damper and base is that of v within epsilon, and of the base.
    omega = numbers["omega0"] * (1 + numbers["epsilon"] * cells.sigma)
    expected = 0.5 * 2.53 * (numbers["b"] * omega * cells.C) ** 2
    assert abs(cells.damper_power / expected - 1).max() < 0.05
    assert cells.impact_power.min() > 0


def test_a_cell_that_fails_has_its_reason_and_stops_nothing():
    cells = vines.sweep(None, {"excitation.G": [0.1, 1.1]}, results="lock", periods=200)
    # As the README shows for the default scene; at G = 0.1, nothing is hit.
    assert cells.lock_sigma.values == pytest.approx([np.nan, -1.139599], abs=4e-6, nan_ok=True)
    assert "no locked point" in cells.failure.values[0]
    assert cells.failure.values[1] == ""
    cells = vines.sweep(None, {"plant.r": [0.9, 1.2]}, periods=200)
    assert cells.regime.values[0] < len(vines.REGIMES)
    assert cells.regime.values[1] == 254
    assert "restitution" in cells.failure.values[1]
    assert np.isnan(cells.followed.values[1])


@pytest.mark.parametrize(
    ("axes", "settings", "parts"),
    [
        ({}, {}, ["at least one axis"]),
        ({"plant.rr": [0.3, 0.5]}, {}, ["plant.rr", "unknown field"]),
        ({"plant.r": [0.3, np.nan]}, {}, ["plant.r", "nan", "finite"]),
        ({"plant.r": 0.5}, {}, ["plant.r = 0.5", "a list of numbers"]),
        ({"plant.r": []}, {}, ["plant.r = []", "at least one"]),
        ({"plant.r": (0.3, 0.9, 7)}, {}, ["plant.r = (0.3, 0.9, 7)", "numpy.linspace", "a list"]),
        ({"plant.r": (0.3, 0.9)}, {}, ["plant.r = (0.3, 0.9)", "numpy.linspace"]),
        ({"plant.r": np.ma.masked_array([0.3, 0.5], [0, 1])}, {}, ["masked"]),
        ({"plant.r": [[0.3, 0.5]]}, {}, ["plant.r = [[0.3, 0.5]]", "a list of numbers"]),
        ({"plant.r": ["0.3", "0.5"]}, {}, ["plant.r", "a list of numbers"]),
        ({"plant.r": ("n", [0.5]), "plant.b": ("n", [0.01, 0.02])}, {}, ["plant.b has 2 values along n", "1"]),
        ({"plant.r": [0.5]}, {"periods": -1}, ["-1 periods", "100"]),
        ({"plant.r": [0.5]}, {"periods": 99}, ["99 periods", "from 100"]),
        ({"plant.r": [0.5]}, {"chunks": {"plant.r": 0}}, ["{'plant.r': 0}", "at least 1"]),
        ({"plant.r": [0.5]}, {"chunks": {"sigma": 4}}, ["'sigma'", "plant.r"]),
        ({"plant.r": [0.5]}, {"results": "locks"}, ["`locks`", "regime, response, orbits and lock"]),
        ({"plant.r": [0.5]}, {"sigma": float("inf")}, ["sigma = inf", "finite"]),
        ({"sigma": [0.5]}, {"sigma": 1.0}, ["sigma is an axis and a constant"]),
    ],
)
def test_bad_axes_and_settings_are_value_errors_and_write_nothing(axes, settings, parts, tmp_path):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        vines.sweep(None, axes, store=tmp_path / "store", **settings)
    for part in parts:
        assert part in str(error.value)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("axes", {"axes": {"plant.r": [0.5, 0.7]}}),
        ("scene", {"scene": vines.Scene(plant={"b": 0.02})}),
        ("sigma", {"sigma": -1.0}),
        ("periods", {"periods": 300}),
        ("results", {"results": ["orbits"]}),
        ("chunks", {"chunks": {"plant.r": 1}}),
    ],
)
def test_a_store_of_another_sweep_is_refused_by_what_differs_and_stays(name, change, tmp_path):
    one = {"scene": None, "axes": {"plant.r": [0.5, 0.6]}, "periods": 200, "store": tmp_path / "store"}
    vines.sweep(**one)
    before = written(tmp_path)
    with pytest.raises(ValueError, match=f"another `{name}`"):
        vines.sweep(**one | change)
    assert written(tmp_path) == before


def test_a_folder_that_cannot_be_written_or_is_something_else_and_a_full_disk_are_explained(tmp_path):
    axes = {"plant.r": [0.5, 0.6]}
    with pytest.raises(OSError, match="/proc/store"):
        vines.sweep(None, axes, store="/proc/store", periods=200)
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match="is not the store of a sweep"):
        vines.sweep(None, axes, store=tmp_path, periods=200)
    with pytest.raises(OSError, match="does not see the store"):
        vines.sweeps._chunk(str(tmp_path / "elsewhere"), None, (0,), [])
    # No file may grow beyond 2 kB, which is enough for metadata: as on a full disk.
    code = f"""
import resource, signal, numpy, vines
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
vines.sweep(None, {{"plant.r": numpy.linspace(0.3, 0.9, 2000)}}, periods=100, sigma=-4.0, store={str(tmp_path / "s")!r})
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "OSError" in done.stderr
    assert "complete chunks stay, and the same call continues" in done.stderr


def test_damaged_chunks_are_named_and_only_they_and_missing_ones_are_computed(whole, tmp_path):
    out = tmp_path / "store"
    vines.sweep(None, AXES, store=out, **SETTINGS)
    flipped, cut, axis = (out / name for name in ("exponent/c/3/0", "regime/c/5/0", "start.dq2/c/0"))
    content = bytearray(flipped.read_bytes())
    content[len(content) // 2] ^= 1
    flipped.write_bytes(content)
    cut.write_bytes(cut.read_bytes()[:-3])
    axis.write_bytes(b"")
    (out / "settling" / "c" / "7" / "0").unlink()
    before = written(out)
    with pytest.warns(RuntimeWarning) as warned:
        vines.sweep(None, AXES, store=out, **SETTINGS)
    message = str(warned[0].message)
    assert message.startswith("3 damaged chunks")
    assert all(f"{file} (" in message for file in (flipped, cut, axis)), message
    after = written(out)
    assert chunks(name for name in after if after[name] != before.get(name)) == {("3", "0"), ("5", "0"), ("7", "0")}
    assert files(out) == whole


def test_metadata_of_arrays_that_are_cut_or_missing_are_written_again_and_no_chunk_is_computed(whole, tmp_path):
    out = tmp_path / "store"
    vines.sweep(None, AXES, store=out, **SETTINGS)
    before = written(out)
    damaged = [out / name / "zarr.json" for name in ("regime", "exponent", "failure", "sigma")]
    for file, length in zip(damaged, (100, 0, None, 300), strict=True):
        if length is None:
            file.unlink()
        else:
            file.write_bytes(file.read_bytes()[:length])
    with pytest.warns(RuntimeWarning) as warned:
        vines.sweep(None, AXES, store=out, **SETTINGS)
    message = str(warned[0].message)
    assert len(warned) == 1
    assert all(str(file) in message for file in damaged), message
    after = written(out)
    assert not chunks(name for name in after if after[name] != before.get(name))
    assert files(out) == whole


def test_without_the_metadata_of_the_store_the_refusal_says_how_its_chunks_are_kept(whole, tmp_path):
    out, other = tmp_path / "store", tmp_path / "other"
    for damage in (b"", None):
        vines.sweep(None, AXES, store=out, **SETTINGS)
        before = written(out)
        file = out / "zarr.json"
        if damage is None:
            file.unlink()
        else:
            file.write_bytes(damage)
        with pytest.raises(ValueError, match=r"copy zarr\.json from there: all chunks are kept") as refused:
            vines.sweep(None, AXES, store=out, **SETTINGS)
        assert str(file) in str(refused.value)
        vines.sweep(None, AXES, store=other, **SETTINGS)
        file.write_bytes((other / "zarr.json").read_bytes())
        vines.sweep(None, AXES, store=out, **SETTINGS)
        after = written(out)
        assert not chunks(name for name in after if after[name] != before.get(name))
        assert files(out) == whole


WRITER = f"""
import numpy, vines
axes = {{"sigma": numpy.linspace(-3.0, 3.0, 31), "start.dq2": numpy.linspace(-0.6, 0.7, 40)}}
vines.sweep(None, axes, store=input(), **{SETTINGS})
"""


def test_after_a_killed_writer_only_missing_chunks_are_computed_and_the_bytes_are_those_of_an_undisturbed_run(
    whole, tmp_path
):
    for kill_at in (1, 12):
        out = tmp_path / str(kill_at)
        writer = subprocess.Popen([sys.executable, "-c", WRITER], stdin=subprocess.PIPE, text=True)
        writer.stdin.write(f"{out}\n")
        writer.stdin.close()
        while writer.poll() is None and len(list((out / "failure").glob("c/*/0"))) < kill_at:
            time.sleep(0.001)
        writer.kill()
        assert writer.wait() == -signal.SIGKILL
        before = written(out)
        complete = {name for name in chunks(before) if sum(chunks([one]) == {name} for one in before) == 12}
        assert kill_at <= len(complete) < 31
        vines.sweep(None, AXES, store=out, **SETTINGS)
        after = written(out)
        assert len(chunks(name for name in after if after[name] != before.get(name))) == 31 - len(complete)
        assert files(out) == whole


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


@pytest.mark.parametrize("stored", [False, True])
@pytest.mark.parametrize("results", ["regime", "lock"])
def test_ctrl_c_ends_a_sweep_within_a_fifth_of_a_second(stored, results, tmp_path):
    # Minutes of work: it is certainly interrupted.
    axes, sent, waited = AXES | {"sigma": np.linspace(-3.0, 3.0, 30_001)}, [], []

    # On an idle machine, all processors compute until the end; their time does not depend on what else runs there.
    def interrupt():
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    for n in range(3):
        timer = threading.Timer(1.0, interrupt)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            vines.sweep(None, axes, results=results, store=tmp_path / str(n) if stored else None)
        waited.append(time.process_time() - sent[-1])
    assert min(waited) < 0.2 * os.cpu_count(), waited


def test_nothing_is_printed_and_a_bar_on_request(tmp_path, capfd):
    vines.sweep(None, {"plant.r": [0.5, 0.6]}, periods=200)
    assert capfd.readouterr() == ("", "")
    vines.sweep(None, {"plant.r": [0.5, 0.6]}, periods=200, progress=True)
    vines.sweep(None, {"plant.r": [0.5] * 3}, periods=200, progress=True, store=tmp_path / "s", chunks={"plant.r": 1})
    printed = capfd.readouterr().err
    assert "2/2" in printed
    assert "3/3" in printed


def cluster(workers):
    return LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None)


def test_a_worker_is_killed_and_one_added_and_the_bytes_are_the_same(whole, tmp_path):
    out = tmp_path / "store"
    with cluster(2) as local, Client(local) as client:
        identity = client.run(os.getpid)

        def disturb():
            os.kill(next(iter(identity.values())), signal.SIGKILL)
            local.scale(3)

        with after_the_first_chunk(out, disturb):
            vines.sweep(None, AXES, store=out, **SETTINGS)
    assert files(out) == whole


def test_after_the_scheduler_ends_another_one_goes_on(tmp_path):
    # More work than what fits into the time in which a scheduler ends.
    settings = SETTINGS | {"periods": 5000}
    out, whole = tmp_path / "store", tmp_path / "whole"
    with (
        cluster(1) as local,
        Client(local),
        after_the_first_chunk(out, local.close),
        pytest.raises(Exception),  # noqa: B017, PT011  whatever the client notices first
    ):
        vines.sweep(None, AXES, store=out, **settings)
    before = written(out)
    with cluster(1) as local, Client(local):
        vines.sweep(None, AXES, store=out, **settings)
    after = written(out)
    assert 0 < sum(after[name] == before.get(name) for name in after if name.startswith("failure/c")) < 31
    vines.sweep(None, AXES, store=whole, **settings)
    assert files(out) == files(whole)
