"""Figures of the tutorials, from what the program `vines` prints.

python studies/book_figures.py PROGRAM [FIGURE ...]    writes docs/FIGURE.svg: manifold, window, responses, cavities; all by default
"""

import json
import re
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt

DOCS = Path(__file__).parent.parent / "docs"
PROGRAM = sys.argv[1]
STABLE, OTHER, MEASURED = "#0072b2", "#999999", "#d55e00"
plt.rcParams.update({"font.size": 9, "svg.fonttype": "none", "font.family": "sans-serif", "svg.hashsalt": "vines"})


def vines(*words):
    return subprocess.run([PROGRAM, *words], capture_output=True, text=True)


def printed(*words):
    return json.loads(vines(*words, "--json").stdout)


def save(figure, name):
    figure.savefig(DOCS / name, metadata={"Date": None})
    plt.close(figure)


def pieces(points):
    """Parts of a branch between changes of stability; neighbours share a point."""
    part = points[:1]
    for start, end in pairwise(points):
        part.append(end)
        if start["stable"] != end["stable"]:
            yield start["stable"], part
            part = [end]
    yield points[-1]["stable"], part


def manifold():
    """C over B: the manifold of the theory with its stable part, and the measured free decay."""
    theory = printed("theory", "--points", "400")
    bounds = theory["manifold"]["B_min"], theory["manifold"]["B_symmetry_breaking"]
    with tempfile.TemporaryDirectory() as folder:
        found = printed("identify", "--rig", "built-in", "--out", folder)
    R = theory["manifold"]["R"]
    speeds = [0.001 * n for n in range(1301)]
    amplitudes = [((R * B) ** 2 + (1 - 1.5707963267948966 * B) ** 2) ** 0.5 for B in speeds]
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    axes.plot(speeds, amplitudes, color=OTHER, ls="--", lw=1, label="manifold, unstable")
    on = [(B, C) for B, C in zip(speeds, amplitudes, strict=True) if bounds[0] <= B <= bounds[1]]
    axes.plot(*zip(*on, strict=True), color=STABLE, lw=2, label="manifold, stable")
    decay = [(point["B"], point["C"]) for point in found["decay"]]
    axes.plot(*zip(*decay, strict=True), ".", color=MEASURED, ms=4, label="free decay, measured")
    lock = found["lock"]
    axes.plot(lock["B"], lock["C"], "o", mfc="white", mec=MEASURED, ms=8, label="lock, G = 1.1")
    axes.set(xlabel="speed of the particle B", ylabel="amplitude of the response C", xlim=(0, 1.3), ylim=(0, 1))
    axes.legend(frameon=False)
    save(figure, "manifold.svg")


def window():
    """Where stable symmetric 1:1 orbits at phase resonance exist, over r and G, and what `vines identify` says."""
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    ratios = [0.3 + 0.02 * n for n in range(36)]
    for r in ratios:
        points = printed("orbit", "--backbone", "--set", f"plant.r={r:.2f}")["points"]
        for stable, part in pieces(points):
            if stable:
                drives = [point["G"] for point in part]
                axes.plot([r, r], [min(drives), max(drives)], color="#a7cfe6", lw=5, solid_capstyle="butt")
    marks = {"lock and decay": "o", "lock, no decay": "s", "held by control": "D", "refused": "x"}
    shown = set()
    for r in (0.3, 0.4, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 1.0):
        with tempfile.TemporaryDirectory() as folder:
            done = vines("identify", "--rig", "built-in", "--set", f"plant.r={r}", "--out", folder)
        if done.returncode:
            kind = "refused"
        elif re.search("the loop holds it", done.stdout):
            kind = "held by control"
        else:
            kind = "lock, no decay" if "No point of the decay" in done.stdout else "lock and decay"
        label = None if kind in shown else kind
        shown.add(kind)
        axes.plot(r, 1.1, marks[kind], color=MEASURED if kind != "refused" else "black", mfc="white", ms=7, label=label)
    axes.set(xlabel="coefficient of restitution r", ylabel="base amplitude G", xlim=(0.27, 1.03), ylim=(0, 2.6))
    axes.legend(frameon=False, title="vines identify at G = 1.1")
    save(figure, "window.svg")


def responses():
    """Exact frequency responses at three drives, and the backbone at phase resonance through their peaks."""
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    back = printed("orbit", "--backbone")["points"]
    axes.plot(
        [p["sigma"] for p in back], [p["C"] for p in back], color="black", lw=1, label="backbone (phase resonance)"
    )
    for number, G in enumerate((1.0, 1.1, 1.3)):
        branches = printed("orbit", "--response", "--range=-3:1", "--set", f"excitation.G={G}")
        if not isinstance(branches, list):
            branches = branches.get("components", branches.get("branches"))
        for branch in branches:
            if not branch["shape"]["mirrored"]:
                continue
            colour = ("#009e73", STABLE, MEASURED)[number]
            for stable, part in pieces(branch["points"]):
                style = {"ls": "-", "lw": 1.6} if stable else {"ls": ":", "lw": 0.9}
                axes.plot([one["sigma"] for one in part], [one["C"] for one in part], color=colour, **style)
        axes.plot([], [], color=colour, label=f"G = {G}")
    axes.set(xlabel="detuning sigma", ylabel="amplitude of the response C", xlim=(-2.5, 0.5), ylim=(0, 0.9))
    axes.legend(frameon=False, loc="upper left")
    save(figure, "responses.svg")


def cavities():
    """Backbones of four real cavities, tracked by `vines backbone`, and that of the ideal cavity by exact orbits."""
    scenes = {
        "rough": ("friction, mu = 0.05", MEASURED, "o"),
        "skewed": ("gaps 1.1 : 0.9", STABLE, "s"),
        "vertical": ("vertical, gravity 0.08 b omega0²", "#009e73", "^"),
        "viscoelastic": ("viscoelastic, r falls with the speed", "#cc79a7", "D"),
    }
    figure, both = plt.subplots(1, 2, figsize=(7.5, 4), layout="constrained", sharey=True)
    ideal = [point for point in printed("orbit", "--backbone")["points"] if point["B"] < 1.3]
    for axes, name in zip(both, ("sigma", "G"), strict=True):
        axes.plot(
            [p[name] for p in ideal], [p["C"] for p in ideal], color="black", lw=1, label="ideal cavity, exact orbits"
        )
    for name, (label, colour, mark) in scenes.items():
        with tempfile.TemporaryDirectory() as folder:
            points = printed("backbone", "--scene", f"scenes/{name}.toml", "--out", folder)["points"]
        points = [p for p in points if p["settled"] and p["regime_by_impacts"] != "no impacts"]
        for axes, key in zip(both, ("sigma", "G"), strict=True):
            place = [p[key] for p in points], [p["C"] for p in points]
            axes.plot(*place, mark, color=colour, mfc="none", ms=4, lw=0, label=label)
    both[0].set(xlabel="detuning sigma", ylabel="amplitude of the response C", xlim=(-2.2, 0.4), ylim=(0, 0.75))
    both[1].set(xlabel="base amplitude G", xlim=(0.8, 1.6))
    both[1].legend(frameon=False, loc="lower right", fontsize=8)
    save(figure, "cavities.svg")


FIGURES = {"manifold": manifold, "window": window, "responses": responses, "cavities": cavities}
for figure in sys.argv[2:] or FIGURES:
    FIGURES[figure]()
