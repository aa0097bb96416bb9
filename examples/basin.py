"""Basins of attraction: from which starts of the primary mass, with the particle at rest, impacts begin and persist.

python examples/basin.py [FOLDER]    writes basin.svg
"""

import csv
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

import vines

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
folder.mkdir(parents=True, exist_ok=True)
scene = vines.Scene(start={"dq2": 0.0})
axes = {"start.q1": np.linspace(-0.0099, 0.0099, 61), "start.dq1": np.linspace(-0.6, 0.6, 61)}
cells = vines.sweep(scene, axes, periods=1000)
with (Path(__file__).parent.parent / "lab/src/report/styles.csv").open() as styles:
    colours = {row["name"]: row["light"] for row in csv.DictReader(styles)}
colours = [colours[name] for name in vines.REGIMES]
plt.rcParams.update({"font.size": 9, "svg.fonttype": "none", "font.family": "sans-serif", "svg.hashsalt": "vines"})
figure, plot = plt.subplots(figsize=(6.5, 4), layout="constrained")
plot.pcolormesh(
    1e3 * cells["start.q1"],
    cells["start.dq1"],
    cells.regime.T,
    cmap=ListedColormap(colours),
    vmin=-0.5,
    vmax=len(colours) - 0.5,
    rasterized=True,
)
# In the order of the regime map.
found = [code for code in range(len(colours)) if (cells.regime == code).any()]
patches = [Patch(facecolor=colours[code], edgecolor="0.6", label=vines.REGIMES[code]) for code in found]
figure.legend(handles=patches, loc="outside right upper", frameon=False)
plot.set(
    xlabel="displacement of the primary mass at the start, mm",
    ylabel="velocity at the start, m/s",
    title="Regimes of the default scene at phase resonance",
)
figure.savefig(folder / "basin.svg", metadata={"Date": None}, dpi=150)
