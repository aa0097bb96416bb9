"""How run times grow with the work, as tables."""

import statistics
from math import log

from tables import NONE, compared, number

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
