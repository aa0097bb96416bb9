"""Backbones over the coefficient of restitution, with their uncertainties, beside first-order theory.

python examples/backbones.py [FOLDER]    writes backbones.svg
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt

import vines

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
folder.mkdir(parents=True, exist_ok=True)
figure, axes = plt.subplots(figsize=(6, 4.5), layout="constrained")
for number, r in enumerate((0.5, 0.65, 0.8)):
    scene = vines.Scene(
        plant={"r": r},
        chain={"snr": 20.0, "seed": 1},
        backbone={"C_from": 0.6, "C_to": 0.25, "points": 8, "precision": 0.02},
    )
    points = vines.backbone(scene).points
    theory = vines.theory(scene).backbone
    # Intervals of 95 %: two standard uncertainties.
    axes.errorbar(
        points["sigma"],
        points["C"],
        2 * points["u_C"],
        2 * points["u_sigma"],
        "o",
        ms=4,
        color=f"C{number}",
        label=f"r = {r}",
    )
    axes.plot(theory["sigma"], theory["C"], color=f"C{number}", lw=1)
axes.set(
    xlabel="detuning $\\sigma$",
    ylabel="amplitude C",
    xlim=(-2, -0.5),
    title="Backbones: measured with noise (o), theory (—)",
)
axes.legend()
figure.savefig(folder / "backbones.svg")
