"""The map of run time: ns per impact over sigma and G, for the plant and for the closed form with Brent's method."""

import csv
import io
from pathlib import Path
from statistics import median

from tables import number, replace, text_table

# First and last values are those of docs/regimes.svg (`vines map`).
SIGMA, G = (-5.0, 5.0), (0.1, 3.0)
POINTS, QUICK_POINTS = (67, 39), (33, 21)
EFFORT = {"periods": 200, "brent_periods": 50, "runs": 7}
# Largest ratios to the default lock that are accepted, as a median and in the worst cell.
ACCEPTED = {"symmetric 1:1": (1.5, 1.5)}
ACCEPTED_ELSEWHERE = (4.0, 8.0)
# Regimes in the order of the legend, with their colours in all figures. Rare impacts: fewer than one per period.
with (Path(__file__).parents[2] / "lab/src/report/styles.csv").open() as styles:
    COLOURS = {row["name"]: row["light"] for row in csv.DictReader(styles)} | {"rare impacts": "#b9b9b9"}
NAMES = ["symmetric 1:1", "asymmetric 1:1", "n impacts", "quasi-periodic", "modulated", "chaotic", "undecided"]
REGIMES = {name: COLOURS[name] for name in ["no impacts", "rare impacts", *NAMES]}
NOTE = (
    "Each cell is the default rig after 400 periods or more at that drive. One step of 200 periods is timed (50 with "
    "Brent's method), in turns with the same step at the default lock (sigma = -1.14, G = 1.1); costs are medians of 7 "
    "runs. A cost is that of an impact, or of a period where impacts are rarer than periods. Ratio: cost over that of "
    "an impact at the lock. Difference: of plant and Brent's method after 20 periods, in half-widths, where the "
    "motion repeats."
)


def values(ends, points):
    first, last = ends
    return [first + (last - first) * n / (points - 1) for n in range(points)]


def measure(worker, points, progress):
    """The cells, row by row from the smallest G, and the lock's ns per impact."""
    sigmas, gs = values(SIGMA, points[0]), values(G, points[1])
    rows, locks = [], []
    for n, g in enumerate(gs, 1):
        progress(f"map of run time: row {n} of {len(gs)}")
        answer = worker.ask({"map_g": g, "sigmas": sigmas, "effort": EFFORT}, 300)
        if answer is None or "error" in answer:
            raise SystemExit(f"error: the map of run time failed at G = {g:g}: {answer}")
        rows.append(answer["cells"])
        locks.append(answer["lock_ns"])
    return rows, median(locks)


def summary(rows):
    """Per regime: cells, cost, ratios to the lock, and how Brent's method compares."""
    counted = any(cell["evaluations"] is not None for row in rows for cell in row)
    head = ["regime", "cells", "ns", "ratio", "worst", "worst at", "accepted", "Brent / plant", "difference"]
    if counted:
        head.append("evaluations: median, worst")
    table = []
    for regime in REGIMES:
        cells = [cell for row in rows for cell in row if cell["regime"] == regime]
        if not cells:
            continue
        worst = max(cells, key=lambda cell: cell["ratio"])
        times = [cell["brent_ns"] / cell["ns"] for cell in cells if cell["brent_ns"]]
        differences = [cell["difference"] for cell in cells if cell["difference"] is not None]
        middle = median(cell["ratio"] for cell in cells)
        accepted = ACCEPTED.get(regime, ACCEPTED_ELSEWHERE)
        met = middle <= accepted[0] and worst["ratio"] <= accepted[1]
        table.append(
            [
                regime,
                str(len(cells)),
                number(median(cell["ns"] for cell in cells)),
                number(middle),
                number(worst["ratio"]),
                f"sigma = {worst['sigma']:.2f}, G = {worst['G']:.2f}",
                f"{'yes' if met else 'no'} ({accepted[0]:g}, {accepted[1]:g})",
                number(median(times)) if times else "\N{EN DASH}",
                f"{max(differences):.0e}" if differences else "\N{EN DASH}",
            ]
        )
        if counted:
            evaluations = [cell["evaluations"] for cell in cells]
            table[-1].append(f"{number(median(evaluations))}, {number(max(evaluations))}")
    return head, table


def lock_line(lock):
    return f"Default lock: {lock:.3g} ns per impact (median)."


def as_text(rows, lock):
    return "\n".join(["Map of run time", NOTE, lock_line(lock), text_table(*summary(rows))])


COLUMNS = ["sigma", "G", "regime", "impacts_per_period", "unit", "ns", "ratio", "evaluations", "brent_ns", "difference"]


def write(rows, lock, folder):
    """run_time_map.csv and run-time-map.svg."""
    table = io.StringIO()
    sheet = csv.writer(table, lineterminator="\n")
    sheet.writerow(COLUMNS)
    for cell in (cell for row in rows for cell in row):
        shown = cell | {
            "sigma": f"{cell['sigma']:.6g}",
            "G": f"{cell['G']:.6g}",
            "ns": number(cell["ns"], 4),
            "ratio": number(cell["ratio"], 4),
            "evaluations": "" if cell["evaluations"] is None else number(cell["evaluations"], 4),
            "brent_ns": "" if cell["brent_ns"] is None else number(cell["brent_ns"], 4),
            "difference": "" if cell["difference"] is None else f"{cell['difference']:.1e}",
        }
        sheet.writerow([shown[name] for name in COLUMNS])
    replace(folder / "run_time_map.csv", table.getvalue())
    draw(rows, lock, folder / "run-time-map.svg")


def draw(rows, lock, file):
    """Three panels: regimes, the plant's cost, and that of Brent's method on the same scale of colours."""
    import figure
    import matplotlib.pyplot as plt
    from matplotlib.colors import ListedColormap, LogNorm
    from matplotlib.patches import Patch

    plt.style.use(figure.STYLE)
    plt.rcParams.update(figure.SMALL | {"axes.grid": False})
    names = list(REGIMES)
    regimes = [[names.index(cell["regime"]) for cell in row] for row in rows]
    plant = [[cell["ns"] for cell in row] for row in rows]
    brent = [[cell["brent_ns"] or float("nan") for cell in row] for row in rows]
    # Half a cell around the outermost values.
    step = (SIGMA[1] - SIGMA[0]) / (len(rows[0]) - 1), (G[1] - G[0]) / (len(rows) - 1)
    extent = (SIGMA[0] - step[0] / 2, SIGMA[1] + step[0] / 2, G[0] - step[1] / 2, G[1] + step[1] / 2)
    options = {"origin": "lower", "extent": extent, "aspect": "auto", "interpolation": "nearest"}
    drawn, axes = plt.subplots(1, 3, figsize=(12.8, 4.3), sharey=True)
    colours = ListedColormap(list(REGIMES.values()))
    axes[0].imshow(regimes, cmap=colours, vmin=-0.5, vmax=len(names) - 0.5, **options)
    scale = LogNorm(lock / 2, 64 * lock)
    for ax, costs in ((axes[1], plant), (axes[2], brent)):
        image = ax.imshow(costs, cmap="viridis", norm=scale, **options)
    bar = drawn.colorbar(image, ax=axes[1:], extend="both", pad=0.01)
    bar.set_label(f"ns per impact, or per period where impacts are rarer\n(default lock: {lock:.0f})")
    titles = ("Regime", "Plant", "Closed form with Brent's method (white: stalls)")
    for ax, title in zip(axes, titles, strict=True):
        ax.set_title(title)
        ax.set_xlabel("detuning sigma")
    axes[0].set_ylabel("base amplitude G")
    used = {cell["regime"] for row in rows for cell in row}
    handles = [Patch(color=colour, label=name) for name, colour in REGIMES.items() if name in used]
    drawn.legend(handles=handles, ncols=len(handles), loc="outside lower center")
    part = file.with_suffix(".part")
    drawn.savefig(part, format="svg", metadata={"Date": None})
    part.replace(file)
    plt.close(drawn)
