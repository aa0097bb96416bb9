"""Run time per impact on a cantilever and a plate of 1 to 8 modes: plant, Brent's method, heyoka, CVODE.

    python structures.py --worker PROGRAM -o FILE.csv [--pairs N]      scripts/bench --structures

Brent's method takes turns with the plant in one process. heyoka compiles the right-hand side and calls Python at
impacts; CVODE (Adams) calls Python for right-hand side and gaps. Differences are the largest from the plant in any
displacement or velocity at the end; the motion of many modes amplifies them.
"""

import argparse
import csv
import time
from itertools import product
from math import cos, nan, sin
from pathlib import Path

from worker import Worker

HERE = Path(__file__).resolve().parent.parent
FAMILIES = ("plate", "cantilever")
MODES = (1, 2, 3, 5, 8)
RUNS = 9


def accelerations(problem, x, v, e, de):
    rows = zip(problem["modes"], x, v, strict=True)
    return [g * (w * w * e + 2 * z * w * de) - 2 * z * w * dq - w * w * q for (w, z, _, g), q, dq in rows]


def rebound(problem, y):
    """The state after an impact; y has displacement and velocity of each mode and of the particle."""
    m, _, r = problem["particle"]
    shapes = [shape for _, _, shape, _ in problem["modes"]]
    dw = sum(s * y[2 * n + 1] for n, s in enumerate(shapes)) - y[-1]
    impulse = -(1 + r) * dw / (sum(s * s for s in shapes) + 1 / m)
    for n, s in enumerate(shapes):
        y[2 * n + 1] += s * impulse
    y[-1] -= impulse / m


def start(problem):
    q1, dq1, q2, dq2 = problem["start"]
    return [q1, dq1, *[0.0] * (2 * len(problem["modes"]) - 2), q2, dq2]


def error(problem, y):
    shapes = [shape for _, _, shape, _ in problem["modes"]]
    q1, dq1 = (sum(s * y[2 * n + k] for n, s in enumerate(shapes)) for k in (0, 1))
    return max(abs(a - b) for a, b in zip((q1, dq1, y[-2], y[-1]), problem["state"], strict=True))


def heyoka(problem, tolerance=1e-15):
    """Seconds and impacts of a run, and its difference from the plant."""
    import heyoka as hy

    count, (_, b, _), (omega, amplitude) = len(problem["modes"]), problem["particle"], problem["drive"]
    names = [f"{kind}{n}" for n in range(count + 1) for kind in "xv"]
    y = hy.make_vars(*names)
    x, v = y[: 2 * count : 2], y[1 : 2 * count : 2]
    e, de = amplitude * hy.sin(omega * hy.time), amplitude * omega * hy.cos(omega * hy.time)
    rates = accelerations(problem, x, v, e, de)
    equations = [pair for n in range(count) for pair in ((x[n], v[n]), (v[n], rates[n]))]
    equations += [(y[-2], y[-1]), (y[-1], 0.0 * y[-2])]
    w = sum(mode[2] * q for mode, q in zip(problem["modes"], x, strict=True)) - y[-2]
    impacts = [0]

    def met(integrator, _sign):
        rebound(problem, integrator.state)
        impacts[0] += 1
        return True

    closing = hy.event_direction.negative
    walls = [hy.t_event(b - s * w, callback=met, direction=closing) for s in (1.0, -1.0)]
    integrator = hy.taylor_adaptive(equations, start(problem), tol=tolerance, t_events=walls, compact_mode=False)
    seconds = []
    for _ in range(RUNS):
        integrator.state[:], integrator.time, impacts[0] = start(problem), 0.0, 0
        integrator.reset_cooldowns()
        began = time.process_time()
        integrator.propagate_until(problem["duration"])
        seconds.append(time.process_time() - began)
    return min(seconds), impacts[0], error(problem, integrator.state)


def cvode(problem, tolerance=1e-9):
    import numpy as np
    from sksundae.cvode import CVODE

    count, (_, b, _), (omega, amplitude) = len(problem["modes"]), problem["particle"], problem["drive"]

    def right(t, y, rate):
        e, de = amplitude * sin(omega * t), amplitude * omega * cos(omega * t)
        rate[: 2 * count : 2] = y[1 : 2 * count : 2]
        rate[1 : 2 * count : 2] = accelerations(problem, y[: 2 * count : 2], y[1 : 2 * count : 2], e, de)
        rate[-2:] = y[-1], 0.0

    def gaps(_t, y, gap):
        w = sum(mode[2] * q for mode, q in zip(problem["modes"], y[: 2 * count : 2], strict=True)) - y[-2]
        gap[:] = b - w, b + w

    gaps.terminal, gaps.direction = [True, True], [-1, -1]
    options = {"rtol": tolerance, "atol": tolerance, "max_num_steps": 100_000}
    solver = CVODE(right, method="Adams", eventsfn=gaps, num_events=2, **options)
    t, end, y, impacts = 0.0, problem["duration"], np.array(start(problem)), 0
    began = time.process_time()
    while t < end:
        found = solver.solve(np.array([t, end]), y)
        t, y = float(found.t[-1]), found.y[-1].copy()
        if t < end:
            rebound(problem, y)
            impacts += 1
    return time.process_time() - began, impacts, error(problem, y)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--worker", required=True)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--pairs", type=int, default=60)
    options = parser.parse_args()
    worker = Worker([options.worker, HERE], greets=False)
    rows = []
    for family, count in product(FAMILIES, MODES):
        # What interrupts a run only adds to its time.
        problems = [worker.ask({"structure": count, "family": family, "pairs": 1}, 60) for _ in range(options.pairs)]
        problem = problems[-1]
        plant, brent = (min(one["ns_per_impact"][n] for one in problems) for n in (0, 1))
        row = {
            "structure": family,
            "modes": count,
            "impacts": problem["impacts"][0],
            "plant_ns_per_impact": round(plant),
        }
        row |= {"brent_over_plant": f"{brent / plant:.3g}", "brent_difference": f"{problem['brent_off']:.0e}"}
        for name, method in (("heyoka", heyoka), ("cvode_python", cvode)):
            seconds, impacts, off = method(problem)
            ratio = 1e9 * seconds / impacts / plant if impacts == problem["impacts"][0] else nan
            row |= {f"{name}_over_plant": f"{ratio:.3g}", f"{name}_difference": f"{off:.0e}"}
        rows.append(row)
        print(row, flush=True)
    worker.end()
    with options.out.open("w", newline="") as file:
        table = csv.DictWriter(file, rows[0], lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    main()
