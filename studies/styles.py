"""Colours of the figures, on white paper, by name: the table of the program."""

import csv
from pathlib import Path

with (Path(__file__).parent.parent / "lab/src/report/styles.csv").open() as table:
    COLOURS = {row["name"]: row["light"] for row in csv.DictReader(table)}
EXACT, THEORY, MEASURED = (COLOURS[name] for name in ("exact", "theory", "measured"))
