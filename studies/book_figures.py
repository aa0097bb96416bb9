"""Figures of the book, from what the program `vines` prints and writes.

python studies/book_figures.py PROGRAM [FIGURE ...]    writes docs/FIGURE.svg, all by default: own (backbone, manifold,
                                                       regimes), window, responses, coverage, cavities
"""

import csv
import json
import re
import shutil
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt
from styles import COLOURS, EXACT, EXACT_UNSTABLE, MEASURED, THEORY

DOCS = Path(__file__).parent.parent / "docs"
PROGRAM = sys.argv[1]
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


def own():
    """Copy the figures that the commands write."""
    with tempfile.TemporaryDirectory() as folder:
        for words in (["identify", "--rig", "built-in"], ["map", "--confirmations", "0"]):
            subprocess.run([PROGRAM, *words, "--out", folder], check=True, capture_output=True)
        for written, name in (("backbone", "backbone"), ("sim", "manifold"), ("map", "regimes")):
            shutil.copy(f"{folder}/{written}.svg", DOCS / f"{name}.svg")


def window():
    """Where stable symmetric 1:1 orbits at phase resonance exist, over r and G, and what `vines identify` says."""
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    ratios = [0.3 + 0.02 * n for n in range(36)]
    for r in ratios:
        points = printed("orbit", "--backbone", "--set", f"plant.r={r:.2f}")["points"]
        for stable, part in pieces(points):
            if stable:
                drives = [point["G"] for point in part]
                axes.plot(
                    [r, r], [min(drives), max(drives)], color=COLOURS["symmetric 1:1"], lw=5, solid_capstyle="butt"
                )
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
    axes.set(
        xlabel="coefficient of restitution r", ylabel="base amplitude G = E/(b ε)", xlim=(0.27, 1.03), ylim=(0, 2.6)
    )
    axes.legend(frameon=False, title="vines identify at G = 1.1")
    save(figure, "window.svg")


def responses():
    """Exact frequency responses at three drives, and the backbone at phase resonance through their peaks."""
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")

    def curve(points, width):
        for stable, part in pieces(points):
            style = {"color": EXACT} if stable else {"color": EXACT_UNSTABLE, "ls": "--"}
            axes.plot([p["sigma"] for p in part], [p["C"] for p in part], lw=width, **style)

    curve(printed("orbit", "--backbone")["points"], 2)
    for G in (1.0, 1.1, 1.3):
        branches = printed("orbit", "--response", "--range=-3:1", "--set", f"excitation.G={G}")
        mirrored = [branch["points"] for branch in branches["components"] if branch["shape"]["mirrored"]]
        for points in mirrored:
            curve(points, 1.0)
        peak = max((p for points in mirrored for p in points if p["stable"]), key=lambda p: p["C"])
        axes.annotate(f"G = {G}", (peak["sigma"] + 0.08, peak["C"]), va="bottom")
    axes.plot([], [], color=EXACT, lw=2, label="backbone (phase resonance)")
    axes.plot([], [], color=EXACT, lw=1, label="frequency response")
    axes.plot([], [], color=EXACT_UNSTABLE, lw=1, ls="--", label="unstable")
    axes.set(xlabel="detuning sigma", ylabel="amplitude of the response C, over b", xlim=(-2.5, 0.5), ylim=(0, 0.9))
    axes.legend(frameon=False, loc="upper left", fontsize=8)
    save(figure, "responses.svg")


def cavities():
    """Backbones of four real cavities, tracked by `vines backbone`, and that of the ideal cavity by exact orbits."""
    scenes = {
        "rough": ("friction, mu = 0.05", MEASURED, "o"),
        "skewed": ("gaps 1.1 : 0.9", COLOURS["symmetric 1:1"], "s"),
        "vertical": ("vertical", "#009e73", "^"),
        "viscoelastic": ("viscoelastic", "#cc79a7", "D"),
    }
    figure, both = plt.subplots(1, 2, figsize=(7.5, 4), layout="constrained", sharey=True)
    orbits = printed("orbit", "--backbone")["points"]
    fold = min(orbits, key=lambda point: point["C"])["B"]
    ideal = [point for point in orbits if fold <= point["B"] < 1.3]
    for axes, name in zip(both, ("sigma", "G"), strict=True):
        axes.plot([p[name] for p in ideal], [p["C"] for p in ideal], color="black", lw=1, label="ideal (exact orbits)")
    for name, (label, colour, mark) in scenes.items():
        with tempfile.TemporaryDirectory() as folder:
            points = printed("backbone", "--scene", f"scenes/{name}.toml", "--out", folder)["points"]
        points = [p for p in points if p["settled"] and p["regime_by_impacts"] != "no impacts"]
        for axes, key in zip(both, ("sigma", "G"), strict=True):
            place = [p[key] for p in points], [p["C"] for p in points]
            axes.plot(*place, mark, color=colour, mfc="none", ms=4, lw=0, label=label)
    both[0].set(xlabel="detuning sigma", ylabel="amplitude of the response C", xlim=(-2.2, 0.4), ylim=(0, 0.75))
    both[1].set(xlabel="base amplitude G", xlim=(0.8, 1.7))
    both[1].legend(frameon=False, loc="lower right")
    save(figure, "cavities.svg")


def coverage():
    """How much the share of errors within the stated 95 % differs from it, from the results in validation/."""
    figure, axes = plt.subplots(figsize=(6, 2.6), layout="constrained")
    names = []
    for study, count, name in (("tracking", "settled", "tracked"), ("locks", "correct", "locks")):
        with (DOCS.parent / f"validation/{study}.csv").open() as table:
            for row in csv.DictReader(table):
                scene = {"none": "the rig", "parameters": "wrong scene"}.get(row.get("difference", "none"))
                if scene is None:
                    continue
                noise = "clean" if row["snr_dB"] == "none" else f"{row['snr_dB']} dB"
                deviation, number = 100 * (float(row["within_1.96u"]) - 0.95), int(row[count])
                axes.plot(deviation, len(names), "o", color=MEASURED, ms=5)
                band = 100 * 1.96 * (0.95 * 0.05 / number) ** 0.5
                axes.barh(len(names), 2 * band, left=-band, height=0.7, color=COLOURS["symmetric 1:1"], zorder=0)
                names.append(f"{name}, {noise}, {scene}")
    axes.axvline(0, color=THEORY, lw=0.8)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set(xlabel="share of errors within 1.96 u, less 95 %, in percentage points")
    save(figure, "coverage.svg")


FIGURES = {"own": own, "window": window, "responses": responses, "coverage": coverage, "cavities": cavities}
for name in sys.argv[2:] or FIGURES:
    FIGURES[name]()
