"""The work-precision picture: a panel per scene, error against time, a line per method."""

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt

# Told apart without colour, too: by grey, dash and marker. This project is black and thick.
STYLES = {
    "plant, Rust": ("#000000", "-", "o"),
    "plant, C interface": ("#000000", "-", "s"),
    "plant, FMPy": ("#000000", "-", "D"),
    "closed form + Brent": ("#0b5fa5", "-", "^"),
    "heyoka": ("#a63603", "-", "v"),
    "diffsol, Tsit45": ("#238b45", "--", "<"),
    "diffsol, BDF": ("#74c476", ":", "<"),
    "CVODE, Adams": ("#6a51a3", "--", ">"),
    "scipy DOP853": ("#d94801", "--", "P"),
    "scipy LSODA": ("#fd8d3c", ":", "P"),
    "scipy Radau": ("#fdae6b", "-.", "P"),
    "RK4 + bisection": ("#636363", "--", "p"),
    "Moreau time-stepping": ("#969696", ":", "h"),
}
LEAST = 1e-16


def write(bench, file):
    plt.rcParams.update({"font.size": 8, "svg.fonttype": "none", "font.family": "sans-serif", "svg.hashsalt": "vines"})
    scenes = list(dict.fromkeys(row.scene for row in bench.rows))
    columns = 4 if len(scenes) > 4 else len(scenes)
    lines = -(-len(scenes) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(3 * columns, 2.7 * lines + 0.9), squeeze=False, sharey=True)
    known = {}
    for ax, scene in zip(axes.flat, scenes, strict=False):
        impacts = max(1, bench.truth[scene]["impacts"])
        for method, (colour, dash, marker) in STYLES.items():
            rows = [row for row in bench.rows if row.scene == scene and row.method == method and row.times]
            points = [(min(row.times) / impacts, max(row.error, LEAST), row.failure) for row in rows]
            good = [(x, y) for x, y, failure in points if failure is None]
            bad = [(x, min(y, 10.0)) for x, y, failure in points if failure]
            own = method.startswith("plant")
            style = {
                "color": colour,
                "linestyle": dash,
                "marker": marker,
                "markersize": 6 if own else 4.5,
                "linewidth": 1.1,
            }
            if good:
                (known[method],) = ax.loglog(*zip(*good, strict=True), **style, zorder=4 if own else 3)
            if bad:
                (wrong,) = ax.loglog(
                    *zip(*bad, strict=True),
                    color=colour,
                    linestyle="",
                    marker=marker,
                    markersize=4.5,
                    markerfacecolor="white",
                    zorder=2,
                )
                known.setdefault(method, wrong)
        failed = {
            row.method
            for row in bench.rows
            if row.scene == scene and not row.times and row.failure and row.method in STYLES
        }
        ax.set_title(scene, fontsize=9, fontweight="bold")
        if failed:
            ax.text(
                0.98,
                0.03,
                "no end at some setting or all:\n" + ",\n".join(sorted(failed)),
                transform=ax.transAxes,
                ha="right",
                va="bottom",
                fontsize=5.5,
            )
        ax.set_ylim(LEAST / 1e3, 1e2)
        ax.grid(True, color="#dddddd", linewidth=0.5)
        ax.set_xlabel("ns per impact")
    for ax in list(axes.flat)[len(scenes) :]:
        ax.axis("off")
    for line in axes:
        line[0].set_ylabel("error")
    figure.legend(known.values(), known.keys(), ncols=5, loc="lower center", frameon=False, fontsize=8)
    figure.tight_layout(rect=(0, 0.9 / (2.7 * lines + 0.9), 1, 1))
    figure.text(0.01, 0.004, "Open markers: wrong answers.", fontsize=7)
    part = file.with_suffix(".part")
    figure.savefig(part, format="svg", metadata={"Date": None})
    part.replace(file)
