"""The figure of docs/measuring.md, on the default scene.

python studies/measuring.py    writes it into docs/

The backbone: E_R(A) and the frequency of phase resonance from held levels, with the exact orbits. In units of the
half-width b and of omega0.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from styles import EXACT, MEASURED

import vines

DOCS = Path(__file__).parent.parent / "docs"

points = vines.backbone().points
levels = np.column_stack([points["C"], points["sigma"], points["G"]])
exact = levels - np.column_stack([0 * points["C"], points["sigma_difference"], points["G_difference"]])
figure, axes = plt.subplots(1, 2, figsize=(7.9, 3.6))
for axis, column, label in zip(axes, (2, 1), ("drive $E_R$ / (ε b)", "detuning of $ω_R$"), strict=True):
    axis.plot(exact[:, 0], exact[:, column], color=EXACT, label="exact orbits")
    axis.plot(levels[:, 0], levels[:, column], ".", color=MEASURED, label="held levels")
    axis.set(xlabel="A / b", ylabel=label)
axes[0].legend()
figure.savefig(DOCS / "measuring-backbone.svg", metadata={"Date": None})
