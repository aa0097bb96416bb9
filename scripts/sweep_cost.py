"""Cost of sweeps and of batches: the tables of docs/scale.md, and ratios; `scripts/sweep-demo --cost` runs it."""

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from dask.distributed import Client, LocalCluster

import vines

RELEASE = Path(sys.argv[1])
FOLDER = Path("out/sweep-cost")
CORES = os.cpu_count() or 1
# SHRINK=20 tries all of it at a twentieth of the size.
SHRINK = int(os.environ.get("SHRINK", "1"))
# Cells of a particle at rest cost little: what remains is the cost of the store.
REST = ["--set=start.dq2=0", "--periods=100"]


def rest(points):
    points = [max(2, count // SHRINK) for count in points]
    return [*REST, f"--axis=start.q1=-0.004:0.004:{points[0]}", f"--axis=start.dq1=-0.2:0.2:{points[1]}"]


def default(points):
    points = [max(2, count // SHRINK) for count in points]
    return ["--periods=400", f"--axis=sigma=-5:5:{points[0]}", f"--axis=excitation.G=0.1:3:{points[1]}"]


def start(options, out, threads):
    command = [RELEASE / "vines", "sweep", "--yes", *options, f"--out={out}"]
    return subprocess.Popen(command, env=os.environ | {"RAYON_NUM_THREADS": str(threads)}, stdout=subprocess.DEVNULL)


def measure(name, options, threads=CORES):
    """A row of the table: one sweep from nothing."""
    out = FOLDER / "store"
    shutil.rmtree(out, ignore_errors=True)
    begin = time.perf_counter()
    child = start(options, out, threads)
    # Not `ru_maxrss`, which has the size of this process before the program began.
    done, memory = 0, 0
    while not done:
        if peak := re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{child.pid}/status").read_text()):
            memory = int(peak[1]) / 1024
        time.sleep(0.005)
        done, status, usage = os.wait4(child.pid, os.WNOHANG)
    seconds = time.perf_counter() - begin
    assert status == 0, name
    files = [one for one in out.rglob("*") if one.is_file()]
    size = sum(one.stat().st_size for one in files)
    work = usage.ru_utime + usage.ru_stime
    print(
        f"| {name} | {seconds:.1f} s | {work:.1f} s | {memory:.0f} MB | {size / 1e6:.1f} MB | {len(files)} |",
        flush=True,
    )
    return seconds


def shards(options, count):
    """Seconds of as many processes with one thread each."""
    out = FOLDER / "store"
    shutil.rmtree(out, ignore_errors=True)
    begin = time.perf_counter()
    running = [start([*options, f"--shard={n + 1}/{count}"], out, 1) for n in range(count)]
    assert all(one.wait() == 0 for one in running)
    return time.perf_counter() - begin


def cluster(workers):
    """Seconds of a sweep on a local cluster of Dask, whose workers have one thread each."""
    out = FOLDER / "store"
    shutil.rmtree(out, ignore_errors=True)
    os.environ["RAYON_NUM_THREADS"] = "1"
    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as local,
        Client(local) as client,
    ):
        client.run(vines.Scene)
        begin = time.perf_counter()
        axes = {
            "sigma": vines.linspace(-5.0, 5.0, 300 // SHRINK),
            "excitation.G": vines.linspace(0.1, 3.0, 300 // SHRINK),
        }
        vines.sweep(None, axes, out=out, periods=400, chunk=3000, client=client)
        return time.perf_counter() - begin


def batch():
    """Least seconds of the batch that lab/sweep/examples/batch.rs advances."""
    scene = vines.Scene()
    numbers = scene.dimensionless
    omega = numbers["omega0"] * (1 - 1.14 * numbers["epsilon"])
    amplitude, unit = numbers["epsilon"] * numbers["G"] * numbers["b"], numbers["omega0"] * numbers["b"]
    least = np.inf
    for _ in range(7):
        plants = vines.Batch(scene, {"dq2": unit * np.linspace(0.3, 0.9, 10_000)})
        begin = time.perf_counter()
        plants.advance(400 * np.pi / omega, amplitude=amplitude, omega=omega, events=False)
        least = min(least, time.perf_counter() - begin)
    return least


def child(threads, code="batch"):
    """Least seconds of a batch in a process with so many threads: in Python, or in Rust."""
    command = [sys.executable, __file__, str(RELEASE), "batch"] if code == "batch" else [RELEASE / "examples" / "batch"]
    environment = os.environ | {"RAYON_NUM_THREADS": str(threads)}
    return float(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def ratios():
    """Ratios of times: two threads, processes and workers against one, and Python against Rust."""
    one, two = (
        measure(f"9 x 10^4 cells of the default map, {name}", default((300, 300)), threads)
        for threads, name in ((1, "one thread"), (2, "two threads"))
    )
    print(f"cells per second and core on the default map: {(300 // SHRINK) ** 2 / one:.0f}")
    print(f"two threads: {one / two:.2f} times the throughput of one", flush=True)
    print(
        f"two processes (shards): {shards(default((300, 300)), 1) / shards(default((300, 300)), 2):.2f} times",
        flush=True,
    )
    print(f"two workers of Dask: {cluster(1) / cluster(2):.2f} times", flush=True)
    # In turns: the speed of a processor changes from minute to minute.
    rounds = [(child(CORES, "rust"), child(CORES), child(1)) for _ in range(3)]
    rust, python, single = (min(column) for column in zip(*rounds, strict=True))
    print(f"batch of 10^4 plants: Rust {rust:.3f} s, Python {python:.3f} s: {python / rust:.2f} times")
    print(f"batch, {CORES} threads: {single / python:.2f} times the throughput of one")


def tables():
    """Cells from 10^3 to 10^7, and chunk sizes."""
    for name, points in [("10^3", (25, 40)), ("10^4", (100, 100)), ("10^5", (250, 400)), ("10^6", (1000, 1000))]:
        measure(f"{name} cells of the default map", default(points))
    for name, points in [("10^4", (100, 100)), ("10^5", (250, 400)), ("10^6", (1000, 1000)), ("10^7", (2500, 4000))]:
        measure(f"{name} cells at rest", rest(points))
    for chunk in (1000, 20_000, 100_000):
        measure(f"10^6 cells at rest, chunks of {chunk}", [*rest((1000, 1000)), f"--chunk={chunk}"])


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    print("| sweep | time | processor time | memory | store | files |\n|---|---|---|---|---|---|")
    if sys.argv[2:] != ["ratios"]:
        tables()
    ratios()
    shutil.rmtree(FOLDER)


if __name__ == "__main__":
    if sys.argv[2:] == ["batch"]:
        print(batch())
    else:
        main()
