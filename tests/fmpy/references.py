"""The reference data: a trajectory and exact orbits computed in 40-digit arithmetic by an independent program."""

import csv
import json
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
FOLDER = ROOT / "tests" / "reference"


def trajectory(scene: str) -> dict:
    """A free run under e = eps G sin(Om tau); numbers come as decimal strings."""
    return json.loads((FOLDER / "trajectories" / f"{scene}.json").read_text())


def stable_orbit(epsilon: float, r: float, excitation: float) -> dict[str, float]:
    """The stable symmetric two-impact orbit at phase resonance with the largest amplitude at these parameters."""
    with (FOLDER / "orbits.csv").open(newline="") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    found = [row for row in rows if (row["eps"], row["r"], row["G"]) == (epsilon, r, excitation) and row["mult4"] < 1]
    return max(found, key=lambda row: row["C"])
