"""The reference data: trajectories and exact orbits computed in 40-digit arithmetic by an independent program."""

import csv
import json
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
FOLDER = ROOT / "tests" / "reference"


def trajectory(scene: str) -> dict:
    """A free run under e = eps G sin(Om tau); numbers come as decimal strings."""
    return json.loads((FOLDER / "trajectories" / f"{scene}.json").read_text())


def orbits() -> list[dict[str, float]]:
    """Exact symmetric two-impact orbits at phase resonance."""
    with (FOLDER / "orbits.csv").open(newline="") as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def stable(row: dict[str, float]) -> bool:
    return all(row[f"mult{n}"] < 1 for n in range(1, 5))


def stable_orbit(epsilon: float, r: float, excitation: float) -> dict[str, float]:
    """The stable orbit with the largest amplitude at these parameters."""
    found = [row for row in orbits() if (row["eps"], row["r"], row["G"]) == (epsilon, r, excitation) and stable(row)]
    return max(found, key=lambda row: row["C"])
