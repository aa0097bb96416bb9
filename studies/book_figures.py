"""Figures of the book, from what the program `vines` prints and writes.

python studies/book_figures.py PROGRAM [FIGURE ...]    writes docs/FIGURE.svg, all by default: own (those
                                                       that commands write), window, coverage, cavities
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
from styles import COLOURS, EXACT, MEASURED, THEORY

DOCS = Path(__file__).parent.parent / "docs"
PROGRAM = sys.argv[1]


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
        for words in (
            ["identify", "--rig", "built-in", "--out", folder],
            ["map", "--confirmations", "0", "--out", folder],
            ["theory", "--figure", f"{folder}/theory.svg"],
            ["orbit", "--response", "--range=-3:1", "--figure", f"{folder}/response.svg"],
        ):
            subprocess.run([PROGRAM, *words], check=True, capture_output=True)
        names = {"sim": "manifold", "map": "regimes", "response": "responses"}
        for written in ("backbone", "sim", "history", "theory", "response", "map"):
            shutil.copy(f"{folder}/{written}.svg", DOCS / f"{names.get(written, written)}.svg")


def window():
    """Where stable symmetric 1:1 orbits at phase resonance exist, over r and G, and what `vines identify` says."""
    figure, axes = plt.subplots(figsize=(7.9, 4.6))
    ratios = [0.3 + 0.05 * n for n in range(15)]
    for r in ratios:
        curves = printed("orbit", "--backbone", "--set", f"plant.r={r:.2f}")
        for stable, part in (piece for curve in curves for piece in pieces(curve["points"])):
            if stable:
                drives = [point["G"] for point in part]
                axes.plot(
                    [r, r], [min(drives), max(drives)], color=COLOURS["symmetric 1:1"], lw=12, solid_capstyle="butt"
                )
    marks = {"lock and decay": "o", "lock, no decay": "s", "held by control": "D", "refused": "x"}
    shown = set()
    for r in ratios:
        with tempfile.TemporaryDirectory() as folder:
            done = vines("identify", "--rig", "built-in", "--set", f"plant.r={r:.2f}", "--out", folder)
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
    axes.legend(title="vines identify at G = 1.1")
    save(figure, "window.svg")


def cavities():
    """Backbones of four real cavities, tracked by `vines backbone`, and that of the ideal cavity by exact orbits."""
    scenes = {
        "rough": ("friction, mu = 0.05", MEASURED, "o"),
        "skewed": ("gaps 1.1 : 0.9", COLOURS["particle"], "s"),
        "vertical": ("vertical", COLOURS["n impacts"], "^"),
        "viscoelastic": ("viscoelastic", COLOURS["predicted"], "D"),
    }
    figure, both = plt.subplots(1, 2, figsize=(7.9, 4.2), sharey=True)
    orbits = [point for curve in printed("orbit", "--backbone") for point in curve["points"]]
    fold = min(orbits, key=lambda point: point["C"])["B"]
    ideal = [point for point in orbits if fold <= point["B"] < 1.3]
    for axes, name in zip(both, ("sigma", "G"), strict=True):
        axes.plot([p[name] for p in ideal], [p["C"] for p in ideal], color=EXACT, label="ideal (exact orbits)")
    for name, (label, colour, mark) in scenes.items():
        with tempfile.TemporaryDirectory() as folder:
            points = printed("backbone", "--scene", f"scenes/{name}.toml", "--out", folder)["points"]
        points = [p for p in points if p["settled"] and p["regime_by_impacts"] != "no impacts"]
        for axes, key in zip(both, ("sigma", "G"), strict=True):
            place = [p[key] for p in points], [p["C"] for p in points]
            axes.plot(*place, mark, color=colour, mfc="none", ms=4, lw=0, label=label)
    both[0].set(xlabel="detuning sigma", ylabel="amplitude of the response C", xlim=(-2.2, 0.4), ylim=(0, 0.75))
    both[1].set(xlabel="base amplitude G", xlim=(0.8, 1.7))
    both[1].legend(loc="lower right")
    save(figure, "cavities.svg")


def coverage():
    """How much the share of errors within the stated 95 % differs from it, from the results in validation/."""
    figure, axes = plt.subplots(figsize=(7.9, 3))
    # Several rows are of one kind, with other seeds: they count together.
    shares = {}
    for study, count, name in (("tracking", "settled", "tracked"), ("locks", "correct", "locks")):
        with (DOCS.parent / f"validation/{study}.csv").open() as table:
            for row in csv.DictReader(table):
                scene = {"none": "the rig", "parameters": "wrong scene"}.get(row.get("difference", "none"))
                if scene is None:
                    continue
                noise = "clean" if row["snr_dB"] == "none" else f"{row['snr_dB']} dB"
                number = int(row[count])
                inside, of = shares.get(f"{name}, {noise}, {scene}", (0, 0))
                shares[f"{name}, {noise}, {scene}"] = inside + number * float(row["within_1.96u"]), of + number
    names = list(shares)
    for place, (inside, number) in enumerate(shares.values()):
        axes.plot(100 * (inside / number - 0.95), place, "o", color=MEASURED, ms=5)
        band = 100 * 1.96 * (0.95 * 0.05 / number) ** 0.5
        axes.barh(place, 2 * band, left=-band, height=0.7, color=COLOURS["symmetric 1:1"], zorder=0)
    axes.axvline(0, color=THEORY, lw=0.8)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set(xlabel="share of errors within 1.96 u, less 95 %, in percentage points")
    save(figure, "coverage.svg")


FIGURES = {"own": own, "window": window, "coverage": coverage, "cavities": cavities}
for name in sys.argv[2:] or FIGURES:
    FIGURES[name]()
