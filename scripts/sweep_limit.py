"""How many cells of a map must be computed if more is known of it than a refinement can know.

In windows of the three maps, every cell is computed at its centre and at 24 places around the centre, inside the cell.

- A rule that knows the 24 regimes infers the most frequent one, and computes the cells in which they agree least.
- A rule that knows how probable each regime is in every cell computes the cells in which no regime is probable. The
  shares of the regimes among the 24 stand for the probabilities. As the cells are chosen by these shares themselves,
  too few seem wrong on average: such a rule needs no fewer cells than are printed.

scripts/sweep-demo runs it.
"""

import random
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import xarray
from sweep_demo import MAPS

SIDE, PLACES, MAP = 8, 5, 1000
WRONG, BUDGET = 0.001, 0.15


def window(vines, case, corner):
    """The regimes of a window, shape (cells, PLACES**2)."""
    out = Path("out/sweep-limit.zarr")
    shutil.rmtree(out, ignore_errors=True)
    options, *ranges = case
    axes = []
    for name, (first, last), at in zip(("sigma", "excitation.G"), ranges, corner, strict=True):
        step = (last - first) / (MAP - 1)
        begin = first + step * (at - (PLACES // 2) / PLACES)
        end = begin + step * (SIDE * PLACES - 1) / PLACES
        axes.append(f"--axis={name}={begin!r}:{end!r}:{SIDE * PLACES}")
    command = [vines, "sweep", *options, *axes, "--periods=400", f"--out={out}"]
    subprocess.run(command, check=True, capture_output=True)
    codes = xarray.open_zarr(out).regime.values.reshape(SIDE, PLACES, SIDE, PLACES)
    return codes.transpose(0, 2, 1, 3).reshape(SIDE**2, PLACES**2)


def main():
    vines, windows, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    chance = random.Random(seed)
    for number, case in enumerate(MAPS):
        corners = [[chance.randrange(1, MAP - SIDE) for _ in range(2)] for _ in range(windows)]
        cells = np.concatenate([window(vines, case, corner) for corner in corners])
        centre, around = cells[:, PLACES**2 // 2], np.delete(cells, PLACES**2 // 2, axis=1)
        counts = (around[:, :, None] == np.arange(8)).sum(axis=1)
        # The cells that are inferred first agree best; in any order where they agree equally.
        order = np.lexsort((np.random.default_rng(seed).random(len(cells)), -counts.max(axis=1)))
        wrong = (counts.argmax(axis=1) != centre)[order]
        doubt = (1 - counts.max(axis=1) / counts.sum(axis=1))[order]
        print(f"map {number + 1}, {len(cells)} cells")
        for rule, share in (("24 regimes known", wrong), ("probabilities known, at least", doubt)):
            share = np.cumsum(share) / len(cells)
            computed = 1 - np.searchsorted(share, WRONG, side="right") / len(cells)
            left = share[round((1 - BUDGET) * len(cells)) - 1]
            print(
                f"  {rule}: {computed:.1%} computed for {1 - WRONG:.1%}; {1 - left:.2%} with {BUDGET:.0%}", flush=True
            )


main()
