"""Tables as text, CSV and Markdown."""

import csv
import io
import os
import platform
import statistics
from datetime import date
from math import log
from pathlib import Path

from measured import short
from tables import NONE, compared, markdown_table, number, ratio, replace, text_table, wrapped


def machine():
    """The kind of machine, as far as it tells."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    kind = names[0] if names else platform.processor() or "processor unknown"
    return f"{kind}, {os.cpu_count()} logical cores, {platform.system()} {platform.machine()}"


def savings(bench):
    """Per scene: what the plant's fast path and long steps save."""
    rows = []
    for scene in dict.fromkeys(row.scene for row in bench.rows):
        timed = {row.name: row for row in bench.rows if row.scene == scene and row.times}

        def over(name, timed=timed):
            return timed[name].over(timed["plant"])[1] if {name, "plant"} <= timed.keys() else None

        general, at_once = over("plant-general"), over("plant-one-step")
        once = None if at_once is None else 1 / at_once
        rows.append([scene, ratio(general), ratio(once)])
    head = ["scene", "by its search", "by not stopping"]
    return head, rows


UNITS = {"periods": "period", "impacts": "impact", "samples per period": "sample"}


def exponent(points):
    """Slope of the least-squares line through the upper half of the points, log against log."""
    upper = points[len(points) // 2 :]
    xs, ys = [log(point[0]) for point in upper], [log(point[1]) for point in upper]
    return statistics.linear_regression(xs, ys).slope


def seconds(x):
    """A time that somebody waits for."""
    for unit, name in ((86400, "days"), (3600, "h"), (60, "min")):
        if x >= 2 * unit:
            return f"{x / unit:.2g} {name}"
    return f"{x:.2g} s"


def growths(curves):
    rows = []
    for what, points in curves.items():
        if len(points) < 4:
            rows.append([what, "not measured: no answer in time", NONE, NONE, NONE])
            continue
        slope = exponent(points)
        size, ns, work = points[-1]
        unit = UNITS.get(what, "plant and period")
        rows.append(
            [
                what,
                f"{points[0][0]:.0f} to {size:.0f}",
                f"{slope:.3f}",
                f"{ns / work:.3g} ns per {unit}",
                f"{1000 * size:.0e}: {seconds(1e-9 * ns * 1000**slope)}".replace("e+0", "e").replace("e+", "e"),
            ]
        )
    return ["what grows", "range", "exponent", "at the end of it", "extrapolated"], rows


def samples(bench):
    """Cost of a sample in the loop scene, method by method."""
    best = {}
    for row in bench.rows:
        if row.scene == "loop" and row.times and not row.failure:
            known = best.get(row.method)
            if known is None or row.error < known.error:
                best[row.method] = row
    plant = best.get("plant, Rust")
    count = bench.scenes["loop"]["steps"]
    table = []
    for method, row in best.items():
        table.append([method, number(row.median / count), *compared(row, plant), f"{row.error:.0e}"])
    return ["method", "ns per sample", "time/plant", "quartiles", "error"], table


GROWTH_NOTE = (
    "Steady 1:1 motion. Periods: a step each; impacts: all in one step; samples: over 100 periods. The exponent is "
    "that of the upper half of the range, in logarithms; the last column goes a thousand times further by it. Times "
    "are medians of three rounds."
)
SAVINGS_NOTE = (
    "Measured, as ratios of run times. By its search: every contact by the plain solver, over the plant as it is. By "
    "not stopping: the plant as asked, over everything in one step."
)


SAMPLE_NOTE = (
    "Wall time over the number of samples in the loop scene, where the drive changes at every sample. Each method is "
    "at its most accurate setting that came to an end. The C interface sets two values and reads four at each sample."
)


def idle(busy):
    """Whether the machine was idle while it measured, in words."""
    if busy is None:
        return "What other programs did meanwhile is not known on this system."
    if busy < 0.1:
        return f"The machine was otherwise idle (other programs: {busy:.2f} cores on average)."
    return f"The machine was not idle: other programs kept {busy:.1f} cores busy on average."


def notes(bench):
    yield f"{date.today().isoformat()}, {machine()}; " + ("quick run" if bench.options.quick else "full run") + "."
    yield f"{bench.rounds} rounds. {idle(bench.busy)}"
    yield "Peers: " + ", ".join(dict.fromkeys(bench.versions)) + "; diffsol and roots as Cargo.lock has them."
    if bench.missing:
        yield "Left out: " + "; ".join(f"{method} ({why})" for method, why in bench.missing.items()) + "."
    if bench.unasked:
        yield "Not in a quick run: " + ", ".join(bench.unasked) + "; other scenes and settings."
    yield "Truth, checked in this run: " + "; ".join(bench.truth_notes) + "."
    yield (
        "Every method is asked for the state after each step of the scene, and stops there as a co-simulation master "
        "has it, on one thread. CVODE in C restarts at impacts and where the drive changes, and interpolates between. "
        "Programs and libraries in Rust are built as the FMUs are: the release profile, no link-time optimisation. "
        "Just-in-time compilation (heyoka) and setting up are not in the times. Methods take turns in an "
        "order drawn anew each round. In the loop, all methods get the drive recorded from controller and plant."
    )
    yield (
        "median_ns: wall time of a run. A round repeats a run for about a tenth of a "
        "second and keeps the median; performance.csv has the median of the rounds, of which all methods have equal "
        "numbers; relative_spread: half the distance of their quartiles. "
        "Methods in Rust and the C interface take turns with the plant in one process: two milliseconds of runs of the "
        "one, then of the other, for a tenth of a second per round; each begins every other pair, so that the state of "
        "the processor, which changes from second to second, meets both. time_over_plant: the median of the ratios of "
        "all pairs, with their quartiles; for the other methods, which run in processes of their own, the ratio of the "
        "medians. "
        "Error: the largest difference of any displacement or velocity from 40-digit arithmetic, over up to "
        "50 instants (half-width of the cavity 1, natural frequency 1). The failure says how a method failed: an error "
        "above 0.1 is a lost trajectory, a particle more than 0.01 beyond its wall (Moreau's scheme: 0.1) at one of "
        "these instants has tunnelled; a gap width is twice the half-width."
    )
    yield (f"Setting: tolerance, or for RK4 and Moreau steps per period. The time limit of a run is {bench.limit:g} s.")


# Methods in the table at a glance, and how they are called there.
SHOWN = {
    "plant": "plant: error",
    "brent": "closed form + Brent",
    "cvode-c": "CVODE in C",
    "heyoka": "heyoka",
    "diffsol-tsit45": "diffsol",
    "cvode": "CVODE, Python",
    "scipy-dop853": "scipy DOP853, Python",
    "rk4": "RK4",
    "moreau": "Moreau",
}
CALLBACKS = (
    "Python in a column's title: the solver calls Python functions for the right-hand side and the gaps to the walls. "
    "heyoka compiles the right-hand side and calls Python at impacts. All others are compiled throughout, in Rust or C."
)
MATRIX_NOTE = (
    "Run time over the plant's (Rust interface, a step at a time), and error, of each method at its most accurate "
    f"setting that came to an end; or how it failed at all of them. {CALLBACKS}"
)


def glance(bench, scene, name):
    """A cell of the table at a glance."""
    rows = [row for row in bench.rows if (row.scene, row.name) == (scene, name)]
    plant = next(row for row in bench.rows if (row.scene, row.name) == (scene, "plant"))
    good = [row for row in rows if row.times and row.failure is None]
    if good:
        best = min(good, key=lambda row: row.error)
        if name == "plant":
            return f"{best.error:.0e}"
        return f"{ratio(best.over(plant)[1])}; {best.error:.0e}"
    return ", ".join(dict.fromkeys(short(row.failure) for row in rows if row.failure)) or NONE


def matrix(bench):
    scenes = list(dict.fromkeys(row.scene for row in bench.rows))
    shown = {name: title for name, title in SHOWN.items() if any(row.name == name for row in bench.rows)}
    return ["scene", *shown.values()], [[scene, *(glance(bench, scene, name) for name in shown)] for scene in scenes]


BEGIN, END = "<!-- ratios: scripts/bench --keep writes what is between these marks -->", "<!-- /ratios -->"


def renew(readme, bench):
    """Writes the short table into a page, between the marks."""
    text = readme.read_text()
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    table = markdown_table(*matrix(bench))
    replace(
        readme,
        wrapped(f"{before}{BEGIN}\n{MATRIX_NOTE}\n\n<!-- from: validation/performance.csv -->\n{table}\n{END}{after}"),
    )


def write(bench, growth, loop, run_times, folder):
    """Writes performance.txt and performance.csv; returns the text."""
    from run_time_map import as_text

    head, rows = matrix(bench)
    text = ["Run time against error", ""]
    for note in notes(bench):
        text += [note, ""]
    text += ["At a glance", MATRIX_NOTE, text_table(head, rows), "", as_text(*run_times), ""]
    text += ["Scenes (times and errors of all methods and settings: performance.csv)"]
    for scene in dict.fromkeys(row.scene for row in bench.rows):
        text += [f"{scene}: {bench.scenes[scene]['title']}"]
    text += [""]
    sections = [
        ("What the plant's search and long steps save", SAVINGS_NOTE, *savings(bench)),
        ("Cost of a sample in the loop scene", SAMPLE_NOTE, *samples(bench)),
        ("Cost as work grows", GROWTH_NOTE, *growths(growth)),
    ]
    for title, note, head, rows in sections:
        text += [title, note, text_table(head, rows), ""]
    sample = f"{min(loop):.3g} ns per sample (least), {statistics.median(loop):.3g} (median)"
    text += [f"Plant and controller in the loop: {sample}."]
    replace(folder / "performance.txt", "\n".join(text) + "\n")
    table = io.StringIO()
    sheet = csv.writer(table, lineterminator="\n")
    sheet.writerow(
        [
            "scene",
            "method",
            "setting",
            "median_ns",
            "relative_spread",
            "time_over_plant",
            "lower_quartile",
            "upper_quartile",
            "rounds",
            "true_impacts",
            "impacts",
            "error",
            "failure",
        ]
    )
    for row in bench.rows:
        plant = next(r for r in bench.rows if (r.scene, r.name) == (row.scene, "plant"))
        timed = [""] * 5
        if row.times:
            ratios = ["" if x is None else number(x, 4) for x in row.over(plant)]
            timed = [round(row.median), number(row.spread), ratios[1], ratios[0], ratios[2]]
        truth = bench.truth[row.scene]["impacts"]
        error = "" if row.error is None else f"{row.error:.3e}"
        sheet.writerow(
            [row.scene, row.method, row.setting, *timed, len(row.times), truth, row.impacts, error, row.failure or ""]
        )
    replace(folder / "performance.csv", table.getvalue())
    return "\n".join(text)
