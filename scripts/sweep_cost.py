"""Cost of sweeps: the table of docs/scale.md, and what 10^7 cells would cost.

python scripts/sweep_cost.py [CELLS]    CELLS of the largest sweep, 10^6 by default; needs the wheel
"""

import os
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import vines


def cost(name, axes, folder, **settings):
    """Print a row of the table; return the processor time of a cell, s."""
    before, begin = resource.getrusage(resource.RUSAGE_SELF), time.perf_counter()
    cells = vines.sweep(None, axes, store=folder, **settings).regime.size
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_SELF)
    user, system = after.ru_utime - before.ru_utime, after.ru_stime - before.ru_stime
    files = [file for file in Path(folder).rglob("*") if file.is_file()]
    size = sum(file.stat().st_size for file in files) / 1e6
    memory = after.ru_maxrss / 1024
    print(
        f"| {name} | {cells} | {wall:.0f} s | {user:.0f} s + {system:.0f} s | {size:.0f} MB | {len(files)} | "
        f"{memory:.0f} MB |",
        flush=True,
    )
    return (user + system) / cells


def main():
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 10**6
    side = round(cells**0.5)

    def axes(side):
        return {"sigma": np.linspace(-5.0, 5.0, side), "excitation.G": np.linspace(0.1, 3.0, side)}

    print(f"{os.cpu_count()} cores; load {os.getloadavg()[0]:.1f}")
    print("| sweep | cells | time | user + system | store | files | memory |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        each = cost("default map, 400 periods", axes(side), f"{folder}/map", periods=400)
        # It reads every chunk, and computes none.
        cost("the same, complete before", axes(side), f"{folder}/map", periods=400)
        cost("default map, 20,000 periods", axes(side // 10), f"{folder}/long")
    print(f"10^7 cells of 400 periods: {1e7 * each / 3600:.1f} core hours")


if __name__ == "__main__":
    main()
