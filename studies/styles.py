"""Style of the figures, that of the Python package, and colours on white paper by name: the table of the program."""

import csv
from pathlib import Path

import matplotlib.pyplot as plt

ROOT = Path(__file__).parent.parent
plt.style.use(ROOT / "python/vines/figures.mplstyle")
with (ROOT / "lab/src/report/styles.csv").open() as table:
    COLOURS = {row["name"]: row["light"] for row in csv.DictReader(table)}
EXACT, THEORY, MEASURED = (COLOURS[name] for name in ("exact", "theory", "measured"))
