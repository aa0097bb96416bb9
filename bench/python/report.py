"""Tables as text, CSV and Markdown."""

import csv
import io
import os
import platform
import statistics
from datetime import date
from math import log
from pathlib import Path

# Where there is nothing to be said.
NONE = "\N{EN DASH}"

SKIPPED = {
    "steady": "the general search: while the particle is faster than the primary mass can ever be, the wall ahead is "
    "met once, and the other one is left behind",
    "decay": "the general search, and the forced terms: nothing drives",
    "grazing": "little: a contact this close to none is left to the general search",
    "chatter": "rebounds below the resolution of doubles; while stuck, the search for impacts",
    "long": "as in the steady scene; a step holds 1000 periods, and nothing is worked out between them",
    "damped": "nothing: heavy damping is not for the quick way",
    "resonance": "nothing: an undamped resonance is not for the quick way",
    "loop": "the search in samples that no wall is within reach of; but each sample brings another frequency",
}


def number(x, digits=3):
    return NONE if x is None else f"{x:.{digits}g}"


def machine():
    """The kind of machine, as far as it tells."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    kind = names[0] if names else platform.processor() or "processor unknown"
    return f"{kind}, {os.cpu_count()} logical cores, {platform.system()} {platform.machine()}"


def per_impact(row, bench):
    return row.median / max(1, bench.truth[row.scene]["impacts"])


def least_per_impact(row, bench):
    return min(row.times) / max(1, bench.truth[row.scene]["impacts"])


def cells(row, bench):
    """What a row shows, in the order of HEAD."""
    setting = {0: NONE}.get(row.setting, f"{row.setting:g}" if row.setting >= 1 else f"{row.setting:.0e}")
    if not row.times:
        return [row.method, setting, NONE, NONE, NONE, str(row.asked), NONE, NONE, row.failure or "not run"]
    plant = next((r for r in bench.rows if r.scene == row.scene and r.name == "plant" and r.times), None)
    ratio = number(min(row.times) / min(plant.times)) if plant else NONE
    spread = NONE if row.spread is None else f"±{100 * row.spread:.0f} %"
    verdict = row.failure or "ok"
    return [
        row.method,
        setting,
        number(per_impact(row, bench)),
        spread,
        number(least_per_impact(row, bench)),
        str(len(row.times)),
        f"{row.error:.0e}",
        ratio,
        verdict,
    ]


HEAD = ["method", "setting", "ns/impact", "spread", "least", "runs", "error", "time/plant", "verdict"]


def text_table(head, rows):
    widths = [max(len(row[n]) for row in [head, *rows]) for n in range(len(head))]
    lines = []
    for row in [head, *rows]:
        lines.append(
            "  ".join(
                cell.ljust(w) if n in (0, len(row) - 1) else cell.rjust(w)
                for n, (cell, w) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
        )
    return "\n".join(lines)


def markdown_table(head, rows):
    align = ["---"] + ["---:"] * (len(head) - 2) + ["---"]
    return "\n".join("| " + " | ".join(row) + " |" for row in [head, align, *rows])


def savings(bench):
    """Per scene: what the plant skipped, and how much longer it takes with the general search only."""
    rows = []
    for scene in dict.fromkeys(row.scene for row in bench.rows):
        times = {row.name: min(row.times) for row in bench.rows if row.scene == scene and row.times}
        saved = number(times["plant-general"] / times["plant"]) if {"plant", "plant-general"} <= times.keys() else NONE
        once = number(times["plant"] / times["plant-one-step"]) if {"plant", "plant-one-step"} <= times.keys() else NONE
        rows.append([scene, saved, once, SKIPPED[scene]])
    return ["scene", "general search only / plant", "a step at a time / one step in all", "what the plant skips"], rows


def exponent(points):
    """Slope of the least-squares line through the upper half of the points, log against log."""
    upper = points[len(points) // 2 :]
    xs, ys = [log(x) for x, _ in upper], [log(y) for _, y in upper]
    return statistics.linear_regression(xs, ys)


def growths(curves):
    rows = []
    for what, points in curves.items():
        if len(points) < 4:
            continue
        slope, _ = exponent(points)
        size, ns = points[-1]
        rows.append(
            [
                what,
                f"{points[0][0]:.0f} to {size:.0f}",
                f"{slope:.3f}",
                f"{ns / size:.3g} ns",
                f"{1e-9 * ns * 1000**slope:.3g} s",
            ]
        )
    rows.append(["plants in a batch", "not measured: no batch interface yet", NONE, NONE, NONE])
    return ["what grows", "range", "exponent", "each, at the end", "a thousand times that"], rows


def notes(bench):
    yield f"{date.today().isoformat()}, {machine()}; " + ("quick run" if bench.options.quick else "full run") + "."
    yield f"Other programs kept {bench.load:.1f} cores busy when it began; least times are what to compare."
    yield "Peers: " + ", ".join(dict.fromkeys(bench.versions)) + "; diffsol and roots as Cargo.lock has them."
    yield (
        "Every method is asked for the state after each step of the scene, on one thread; just-in-time compilation "
        "(heyoka) and setting up are not in the times. Runs take turns in an order drawn anew each round."
    )
    yield (
        "ns/impact: median of the wall time of a run over the true number of impacts; spread: half the distance of the "
        "quartiles; least: the quickest run, which other programs on the machine disturb least, and which time/plant "
        "compares. Error: the largest difference of any displacement or velocity from 40-digit arithmetic, over up to "
        "50 instants (half-width of the cavity 1, natural frequency 1). The verdict says how a method failed."
    )
    yield (
        "Setting: tolerance, or for RK4 and Moreau steps per period. The time limit of a run is "
        + f"{bench.limit:g} s."
    )
    if bench.missing:
        yield "Left out: " + "; ".join(f"{method} ({why})" for method, why in bench.missing.items()) + "."


def write(bench, growth, loop, folder):
    """Writes performance.txt, .csv and .md; returns the text."""
    scenes = list(dict.fromkeys(row.scene for row in bench.rows))
    text, mark = ["Run time against error", ""], ["# Run time against error", ""]
    for note in notes(bench):
        text += [note, ""]
        mark += [note, ""]
    mark += [
        "`scripts/bench --out docs` writes this page; the picture's numbers are in [performance.csv](performance.csv).",
        "",
    ]
    mark += ["![Error against time, scene by scene](work-precision.svg)", ""]
    for scene in scenes:
        title = bench.scenes[scene]["title"]
        count = f"{bench.truth[scene]['impacts']} impacts"
        rows = [cells(row, bench) for row in bench.rows if row.scene == scene]
        text += [f"{scene}: {title} ({count})", text_table(HEAD, rows), ""]
        mark += [
            f"## {title[0].upper()}{title[1:]}",
            "",
            f"{count[0].upper()}{count[1:]}.",
            "",
            markdown_table(HEAD, rows),
            "",
        ]
    sections = [
        ("What the plant skips, and what that saves", *savings(bench)),
        ("Cost as work grows", *growths(growth)),
    ]
    for title, head, rows in sections:
        text += [title, text_table(head, rows), ""]
        mark += [f"## {title}", "", markdown_table(head, rows), ""]
    sample = f"{min(loop):.3g} ns per sample (least), {statistics.median(loop):.3g} (median)"
    pair = f"Plant and controller in the loop: {sample}."
    text += [pair]
    mark += [pair, ""]
    (folder / "performance.txt").write_text("\n".join(text) + "\n")
    (folder / "performance.md").write_text("\n".join(mark).rstrip() + "\n")
    table = io.StringIO()
    sheet = csv.writer(table, lineterminator="\n")
    sheet.writerow(
        [
            "scene",
            "method",
            "setting",
            "median_ns",
            "least_ns",
            "relative_spread",
            "runs",
            "true_impacts",
            "impacts",
            "error",
            "failure",
        ]
    )
    for row in bench.rows:
        timed = [round(row.median), round(min(row.times)), number(row.spread)] if row.times else ["", "", ""]
        truth = bench.truth[row.scene]["impacts"]
        error = "" if row.error is None else f"{row.error:.3e}"
        sheet.writerow(
            [row.scene, row.method, row.setting, *timed, len(row.times), truth, row.impacts, error, row.failure or ""]
        )
    (folder / "performance.csv").write_text(table.getvalue())
    return "\n".join(text)
