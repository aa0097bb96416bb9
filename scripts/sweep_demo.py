"""Adaptive maps, a basin of attraction and 20 kills, with the program `vines`; scripts/sweep-demo runs it."""

import csv
import os
import random
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import matplotlib.pyplot as plt
import xarray
from matplotlib.colors import ListedColormap

# The regimes in the order of their numbers in a store, with the colours of all figures.
with Path("lab/src/report/styles.csv").open() as styles:
    COLOURS = {row["name"]: row["light"] for row in csv.DictReader(styles)}
# SHRINK=20 tries all of it at a twentieth of the size.
POINTS = 1000 // int(os.environ.get("SHRINK", "1"))


def scene(epsilon, decay, restitution, start):
    """Options for a dimensionless scene: lengths in half-widths, times over omega0."""
    plant = {"epsilon": epsilon, "lambda": decay, "r": restitution}
    start = dict(zip(("q1", "dq1", "q2", "dq2"), start, strict=True))
    values = [f"plant.{key}={value}" for key, value in plant.items()] + [f"start.{k}={v}" for k, v in start.items()]
    return ["--scene=scenes/dimensionless.toml"] + [f"--set={value}" for value in values]


def grid(axes, points=POINTS):
    return [f"--axis={axis}:{points}" for axis in axes] + ["--periods=400"]


# The cases of lab/model/tests/agreement.rs.
MAPS = [
    (scene(0.0084, 1.43, 0.65, (0, 0, 0, 0.9)), (-5, 5), (0.1, 3)),
    (scene(0.03, 0.4, 0.8, (0.3, 0, 0, -0.5)), (-4, 4), (0.1, 2)),
    (scene(0.02, 0.8, 0.4, (0, 0.7, 0.4, 0.3)), (-3, 3), (0.2, 4)),
]
# Detunings that differ by this give the same motion at first, and another one after some tens of periods of chaos.
SHIFT = 1e-12
BASIN = ["--set=start.dq2=0", *grid(["start.q1=-0.0099:0.0099", "start.dq1=-0.6:0.6"])]


def regime_map(case, shift=0.0):
    options, (least, most), (first, last) = case
    axes = [f"sigma={least + shift!r}:{most + shift!r}", f"excitation.G={first}:{last}"]
    return options + grid(axes)


def sweep(vines, options, out):
    """Run `vines sweep` and print its cost; returns the store."""
    shutil.rmtree(out, ignore_errors=True)
    start = time.perf_counter()
    done = subprocess.run(
        [vines, "sweep", "--yes", *options, f"--out={out}"], check=True, capture_output=True, text=True
    )
    seconds = time.perf_counter() - start
    computed = int(re.search(r"(\d+) computed", done.stdout)[1])
    cells = xarray.open_zarr(out)
    inferred = int((cells.inferred == 1).sum()) if "inferred" in cells else 0
    print(
        f"{out.name}: {cells.regime.size} cells, {computed} computed in {seconds:.1f} s: "
        f"{computed / seconds:.0f} per second; {100 * inferred / cells.regime.size:.1f} % inferred",
        flush=True,
    )
    return cells


def draw(cells, labels, path):
    names = [name.replace("_", " ") for name in cells.regime.attrs["flag_meanings"].split()]
    names = [name for name in names if name in COLOURS]  # without "failed" and "not computed"
    x, y = cells.regime.dims
    figure, plot = plt.subplots(figsize=(7, 4.6), layout="constrained")
    extent = [float(cells[x][0]), float(cells[x][-1]), float(cells[y][0]), float(cells[y][-1])]
    style = {"origin": "lower", "extent": extent, "aspect": "auto", "interpolation": "nearest"}
    style |= {"cmap": ListedColormap([COLOURS[name] for name in names]), "vmin": -0.5, "vmax": len(names) - 0.5}
    image = plot.imshow(cells.regime.values.T, **style)
    plot.locator_params(axis="x", nbins=6)
    figure.colorbar(image, ticks=range(len(names))).set_ticklabels(names)
    plot.set(xlabel=labels[0], ylabel=labels[1])
    figure.savefig(path, dpi=110)


def kills(vines, folder):
    """Kill an adaptive and a plain sweep 20 times each at random times; compare the bytes with an undisturbed run."""
    for kind in [["--adaptive"], []]:
        options = [vines, "sweep", *grid(["sigma=-3:3", "excitation.G=0.5:2"], 70), "--chunk=100", *kind]
        whole, killed = folder / "whole", folder / "killed"
        for out in (whole, killed):
            shutil.rmtree(out, ignore_errors=True)
        start = time.perf_counter()
        subprocess.run([*options, f"--out={whole}"], check=True, capture_output=True)
        seconds, count = time.perf_counter() - start, 0
        while count < 20:
            child = subprocess.Popen(
                [*options, f"--out={killed}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            try:
                child.wait(random.uniform(0, 0.3 * seconds))
                shutil.rmtree(killed)  # complete before the last kill: again from nothing
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
                count += 1
        subprocess.run([*options, f"--out={killed}"], check=True, capture_output=True)
        same = subprocess.run(["diff", "-r", whole, killed], check=False).returncode == 0
        print(
            f"{count} kills of {'an adaptive' if kind else 'a plain'} sweep: bytes {'the same' if same else 'DIFFER'}"
        )
        if not same:
            sys.exit(1)


def main():
    vines, mode = sys.argv[1], sys.argv[2:]
    folder = Path("out/sweep-demo")
    folder.mkdir(parents=True, exist_ok=True)
    figures = Path("docs") if "--docs" in mode else folder
    for number, case in enumerate(MAPS if "--full" in mode else MAPS[:1]):
        refined = sweep(vines, [*regime_map(case), "--adaptive"], folder / f"map-{number + 1}.zarr")
        if number == 0:
            draw(refined, ("detuning", "excitation G"), figures / "sweep-map.png")
        if "--full" in mode:
            full = sweep(vines, regime_map(case), folder / f"full-{number + 1}.zarr").regime.values
            again = sweep(vines, regime_map(case, SHIFT), folder / f"again-{number + 1}.zarr").regime.values
            inferred = refined.inferred.values == 1
            print(
                f"map {number + 1}: {100 * (refined.regime.values == full).mean():.3f} % identical; with detunings "
                f"that differ by {SHIFT}, all cells: {100 * (again == full).mean():.3f} % identical, and without the "
                f"cells that the adaptive map computes: {100 * (1 - ((again != full) & inferred).mean()):.3f} %",
                flush=True,
            )
    basin = sweep(vines, [*BASIN, "--adaptive"], folder / "basin.zarr")
    draw(basin, ("q1 at the start, m", "q1' at the start, m/s"), figures / "sweep-basin.png")
    kills(vines, folder)


if __name__ == "__main__":
    main()
