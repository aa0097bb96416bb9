"""Basins of attraction: from which starts of the primary mass, with the particle at rest, impacts begin and persist.

python examples/basin.py [FOLDER]    writes basin.zarr and basin.svg; continues an interrupted sweep
"""

import csv
import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.colors import ListedColormap

import vines

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
folder.mkdir(parents=True, exist_ok=True)
scene = vines.Scene(start={"dq2": 0.0})
axes = {"start.q1": vines.linspace(-0.0099, 0.0099, 61), "start.dq1": vines.linspace(-0.6, 0.6, 61)}
cells = vines.sweep(scene, axes, out=folder / "basin.zarr", periods=1000)
found = [code for code in range(len(vines.REGIMES)) if (cells.regime == code).any()]
position = cells.regime.copy(data=[[found.index(code) for code in row] for row in cells.regime.values])
figure, plot = plt.subplots(figsize=(6, 4.5), layout="constrained")
with (Path(__file__).parent.parent / "lab/src/report/styles.csv").open() as styles:
    colour = {row["name"]: row["light"] for row in csv.DictReader(styles)}
colours = ListedColormap([colour[vines.REGIMES[code]] for code in found])
image = plot.pcolormesh(
    1e3 * cells["start.q1"], cells["start.dq1"], position.T, cmap=colours, vmin=-0.5, vmax=len(found) - 0.5
)
figure.colorbar(image, ticks=range(len(found))).set_ticklabels([vines.REGIMES[code] for code in found])
plot.set(
    xlabel="q1 at the start, mm",
    ylabel="q1' at the start, m/s",
    title=f"$\\sigma$ = {json.loads(cells.attrs['vines'])['sigma']:.4f}, G = 1.1",
)
figure.savefig(folder / "basin.svg")
