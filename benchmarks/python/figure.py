"""The work-precision figure: a panel per scene, error against time, a line per method."""

from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt
from matplotlib.lines import Line2D
from measured import short, time_at_the_limit

# Told apart without colour, too: by dash and marker. This project is black; a family of methods has one colour.
STYLES = {
    "plant, Rust": ("#000000", "-", "o"),
    "plant, C interface": ("#000000", "-", "s"),
    "plant, FMPy": ("#000000", "-", "D"),
    "closed form + Brent": ("#0072b2", "-", "^"),
    "heyoka": ("#d1006c", "-", "v"),
    "diffsol, Tsit45": ("#009e73", "--", "<"),
    "diffsol, BDF": ("#009e73", ":", ">"),
    "CVODE in C": ("#7b3fb5", "-", "H"),
    "CVODE, Adams": ("#7b3fb5", "--", "h"),
    "scipy DOP853": ("#e66100", "--", "P"),
    "scipy LSODA": ("#e66100", ":", "X"),
    "scipy Radau": ("#e66100", "-.", "d"),
    "RK4 + bisection": ("#8c6d1f", "--", "p"),
    "Moreau time-stepping": ("#808080", ":", "8"),
}
TITLES = {
    "steady": "Steady 1:1, 1000 periods",
    "centre": "1:1 at the linear resonance",
    "asymmetric": "Asymmetric 1:1",
    "three": "Three impacts per period",
    "chaotic": "Chaotic, 30 periods",
    "decay": "Transient decay",
    "grazing": "Grazing contact",
    "chatter": "Chatter to sticking",
    "long": "Long run, 10\N{SUPERSCRIPT FIVE} periods",
    "damped": "Heavy damping",
    "resonance": "Undamped resonance",
    "loop": "Controller in the loop",
}
STYLE = Path(__file__).parents[2] / "python/vines/figures.mplstyle"
# For panels of a third of the usual width.
SMALL = {"font.size": 8, "axes.titlesize": 9.5, "axes.labelsize": 8.5}
LEAST = 1e-16
TOO_SLOW = 1e3
CAPTION = (
    "Open markers: wrong answers (an impact missed, the wall tunnelled through, the trajectory lost). "
    "At the top: given up at the time limit, where the run would have ended. Faster is left, better is down."
)


def panel(ax, bench, scene):
    """Lines and markers of one scene."""
    impacts = max(1, bench.truth[scene]["impacts"])
    ended_badly = {}
    for method, (colour, dash, marker) in STYLES.items():
        rows = [row for row in bench.rows if row.scene == scene and row.method == method]
        own = method.startswith("plant")
        size = {"o": 6, "s": 5.5}.get(marker, 5)
        style = {"color": colour, "marker": marker, "markersize": size, "linewidth": 1.1, "zorder": 4 if own else 3}
        points = [(row.median / impacts, max(row.error, LEAST), row.failure) for row in rows if row.times]
        good = [(x, y) for x, y, failure in points if failure is None]
        bad = [(x, min(y, 10.0)) for x, y, failure in points if failure]
        slow = [time_at_the_limit(row.failure, bench.limit, impacts) for row in rows if not row.times]
        slow = [(x, TOO_SLOW) for x in slow if x]
        if good:
            ax.loglog(*zip(*good, strict=True), **style, linestyle=dash)
        for points in (bad, slow):
            if points:
                ax.loglog(*zip(*points, strict=True), **style, linestyle="", markerfacecolor="white", clip_on=False)
        for row in rows:
            if not row.times and row.failure and not time_at_the_limit(row.failure, bench.limit, impacts):
                word = short(row.failure)
                if word != "\N{EN DASH}":
                    ended_badly.setdefault(word, []).append(method)
    words = [f"{word}: {', '.join(dict.fromkeys(methods))}" for word, methods in ended_badly.items()]
    if words:
        text = "\n".join(line for word in words for line in broken(word, 40))
        ax.text(0.98, 0.03, text, transform=ax.transAxes, ha="right", va="bottom", fontsize=6.5)
    ax.set_title(TITLES.get(scene, scene))
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(1e-20, 1e5)
    ax.set_yticks([1e-16, 1e-12, 1e-8, 1e-4, 1e0])
    ax.axhline(1e2, color="#999999", linewidth=0.6)
    ax.text(0.02, 0.975, "time limit", transform=ax.transAxes, ha="left", va="top", fontsize=6.5, color="#555555")
    ax.set_xlabel("ns per impact")
    ax.tick_params(labelbottom=True)


def broken(text, width):
    """Lines of at most so many characters, broken at commas."""
    lines = [""]
    for piece in text.replace(", ", ",\0").split("\0"):
        if len(lines[-1]) + len(piece) > width:
            lines.append("")
        lines[-1] += (" " if lines[-1] else "") + piece
    return lines


def write(bench, file):
    plt.style.use(STYLE)
    plt.rcParams.update(SMALL)
    scenes = list(dict.fromkeys(row.scene for row in bench.rows))
    columns = min(4, len(scenes))
    lines = -(-len(scenes) // columns)
    foot = 1.0
    height = 2.9 * lines + foot
    figure, axes = plt.subplots(
        lines, columns, figsize=(3.2 * columns, height), squeeze=False, sharex=True, layout="none"
    )
    for ax, scene in zip(axes.flat, scenes, strict=False):
        panel(ax, bench, scene)
    for ax in list(axes.flat)[len(scenes) :]:
        ax.axis("off")
    for line in axes:
        line[0].set_ylabel("largest error (half-widths)")
    shown = {row.method for row in bench.rows}
    handles = [
        Line2D([], [], color=colour, linestyle=dash, marker=marker, label=method)
        for method, (colour, dash, marker) in STYLES.items()
        if method in shown
    ]
    figure.legend(handles=handles, ncols=5, loc="upper center", bbox_to_anchor=(0.5, foot / height), fontsize=8.5)
    figure.tight_layout(rect=(0, foot / height, 1, 1))
    figure.text(0.5, 0.06 / height, CAPTION, ha="center", va="bottom")
    part = file.with_suffix(".part")
    figure.savefig(part, format="svg", metadata={"Date": None})
    part.replace(file)
    plt.close(figure)
