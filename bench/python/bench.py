"""Run time against error: this plant and what a user would otherwise pick, on the same scenes, in one run.

Started by scripts/bench, which builds and installs what is needed.
"""

import argparse
import json
import os
import random
import statistics
import sys
import time
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

import picture
import report
from scenes import LOOP_PERIODS, load
from worker import Missing, Worker

HERE = Path(__file__).parent.parent
TOLERANCES = (1e-6, 1e-9, 1e-12)
STEPS = (100, 1000, 10000)

# Name in the tables, side, name there, settings, those of a quick run.
METHODS = [
    ("plant, Rust", "rust", "plant", (0,), (0,)),
    ("plant, one step in all", "rust", "plant-one-step", (0,), (0,)),
    ("plant, 100 times the steps", "rust", "plant-100", (0,), ()),
    ("plant, general search only", "rust", "plant-general", (0,), (0,)),
    ("plant, C interface", "rust", "c-interface", (0,), (0,)),
    ("plant, FMPy", "python", "fmpy", (0,), (0,)),
    ("closed form + Brent", "rust", "brent", TOLERANCES, (1e-12,)),
    ("heyoka", "python", "heyoka", (1e-9, 1e-12, 1e-15), (1e-15,)),
    ("diffsol, Tsit45", "rust", "diffsol-tsit45", TOLERANCES, (1e-9,)),
    ("diffsol, BDF", "rust", "diffsol-bdf", (1e-6, 1e-9), ()),
    ("CVODE, Adams", "python", "cvode", TOLERANCES, (1e-9,)),
    ("scipy DOP853", "python", "scipy-dop853", TOLERANCES, (1e-9,)),
    ("scipy LSODA", "python", "scipy-lsoda", TOLERANCES, ()),
    ("scipy Radau", "python", "scipy-radau", (1e-6, 1e-9), ()),
    ("RK4 + bisection", "rust", "rk4", STEPS, (1000,)),
    ("Moreau time-stepping", "rust", "moreau", STEPS, (1000,)),
]
QUICK = ("steady", "grazing", "chatter", "loop")


@dataclass
class Row:
    """One method at one setting on one scene."""

    scene: str
    method: str
    side: str
    name: str
    setting: float
    times: list = field(default_factory=list)
    error: float | None = None
    impacts: int = 0
    failure: str | None = None
    asked: int = 0

    @property
    def median(self):
        return statistics.median(self.times)

    @property
    def spread(self):
        """Half the distance of the quartiles, as a part of the median."""
        if len(self.times) < 2:
            return None
        low, _, high = statistics.quantiles(self.times, n=4, method="inclusive")
        return 0.5 * (high - low) / self.median


def judge(row, scene, truth, answer, checks):
    """Sets error, impacts, and what is wrong with the answer, if something is."""
    row.impacts = answer["impacts"]
    wanted = {entry[0]: entry[1:5] for entry in truth["rows"]}
    error, widest = Decimal(0), 0.0
    for n, state in zip(checks, answer["states"], strict=True):
        error = max(error, *(abs(Decimal(x) - Decimal(y)) for x, y in zip(state, wanted[n], strict=True)))
        widest = max(widest, abs(state[0] - state[2]) / scene["b"])
    row.error = float(error)
    if row.error != row.error or widest > 1.01:
        row.failure = f"tunnelled through the wall: |w| = {widest:.3g} b"
    elif row.name in ("rk4", "moreau") and row.error < 0.1 * scene["b"] and row.impacts == truth["impacts"]:
        return
    elif row.impacts < truth["impacts"] and not truth["events"] and row.error > 1e-7:
        row.failure = f"missed impacts: {row.impacts} of {truth['impacts']}, error {row.error:.0e}"
    elif row.error > 0.1 * scene["b"]:
        row.failure = f"lost the trajectory: error {row.error:.1g}"


class Bench:
    """Workers, scenes, truth, rows."""

    def __init__(self, options):
        self.options = options
        self.scenes = load(HERE / "scenes.json")
        self.truth = json.loads((HERE / "truth.json").read_text())
        self.limit = 1.5 if options.quick else 8.0
        self.budget = 0.05 if options.quick else 0.1
        self.workers, self.missing, self.versions = {}, {}, []
        self.rows = []
        self.load = os.getloadavg()[0]

    def say(self, text, end="\n"):
        if end == "\n" or sys.stderr.isatty():
            print(text, end=end, file=sys.stderr, flush=True)

    def start(self):
        rust = Worker([self.options.worker, HERE], greets=False)
        known = rust.ask({"methods": True}, 60)
        scenes = [s for s in self.scenes if s in self.truth and (not self.options.quick or s in QUICK)]
        for method, side, name, settings, quick in METHODS:
            if self.options.quick:
                settings = quick
            if not settings:
                continue
            if side == "rust":
                if name not in known:
                    self.missing[method] = "not built: diffsol could not be had"
                    continue
                self.workers[name] = rust
            else:
                command = [sys.executable, HERE / "python/peers.py", name, HERE / "scenes.json", self.options.fmu]
                try:
                    self.workers[name] = Worker(command, greets=True)
                except Missing as why:
                    self.missing[method] = str(why)
                    continue
                self.versions.append(self.workers[name].hello["version"])
            self.rows += [Row(scene, method, side, name, setting) for scene in scenes for setting in settings]
        self.rehearse()
        for method, why in self.missing.items():
            self.say(f"warning: {method} is left out: {why}")

    def rehearse(self):
        """Loads and compiles what will be needed: that is not in the times."""
        for name in ("c-interface", "heyoka"):
            for row in [row for row in self.rows if row.name == name]:
                self.say(f"\rpreparing {name}: {row.scene}        ", end="")
                request = {"scene": row.scene, "method": name, "setting": row.setting, "checks": [1]}
                self.workers[name].ask(request | {"budget": 0.0, "limit": 0.01}, 600)
        self.say("")

    def run(self, row):
        scene = self.scenes[row.scene]
        checks = scene["checks"]
        if row.name == "plant-one-step":
            if row.scene == "loop":
                row.failure = "not asked: the drive changes with every sample"
                return
            checks = checks[-1:]
        request = {"scene": row.scene, "method": row.name, "setting": row.setting, "checks": checks}
        if row.name == "plant-one-step":
            request["checks"] = []
        answer = self.workers[row.name].ask(request | {"budget": self.budget, "limit": self.limit}, 4 * self.limit + 30)
        row.asked += 1
        if answer is None:
            row.failure = f"hung: killed after {4 * self.limit + 30:g} s"
        elif answer.get("error") or answer.get("failure"):
            row.failure = answer.get("error") or answer["failure"]
        else:
            row.times += answer["ns"]
            if row.error is None:
                judge(row, scene, self.truth[row.scene], answer, checks)

    def measure(self):
        """Round after round, in an order drawn anew each time, until the time is over."""
        began = time.monotonic()
        total = self.options.seconds or (60 if self.options.quick else 1000)
        dice = random.Random(1)
        rounds = 0
        while rounds < 3 or (rounds < 12 and time.monotonic() - began < 0.7 * total):
            order = [row for row in self.rows if row.failure is None or row.asked == 0]
            dice.shuffle(order)
            for n, row in enumerate(order):
                gone = time.monotonic() - began
                self.say(
                    f"\rround {rounds + 1}: {n + 1} of {len(order)}, {gone:.0f} s, {row.scene}: {row.method:28}", end=""
                )
                slow = row.times and row.median > 0.25e9
                if rounds and (gone > total or (slow and rounds > 2) or (slow and gone > 0.6 * total)):
                    continue
                self.run(row)
            rounds += 1
            self.say(f"\nround {rounds} done after {time.monotonic() - began:.0f} s")
            if time.monotonic() - began > total:
                break

    def growth(self):
        """What grows: points of size and ns."""
        rust = next(iter(self.workers.values()))
        most = {"periods": 1e6, "impacts": 1e7, "samples per period": 1e4}
        if self.options.quick:
            most = {"periods": 1e4, "impacts": 1e5, "samples per period": 1e3}
        curves = {}
        for what, end in most.items():
            answer = rust.ask({"growth": what, "budget": 0.05, "most": end}, 120)
            curves[what] = answer["points"] if answer else []
        loop = rust.ask({"closed_loop": LOOP_PERIODS, "budget": 0.2 if self.options.quick else 2.0}, 60)
        return curves, loop["ns"]


def main():
    parser = argparse.ArgumentParser(
        prog="scripts/bench", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="four scenes, one setting for most methods; under two minutes"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out/bench"), help="folder for tables and picture (default %(default)s)"
    )
    parser.add_argument("--seconds", type=float, help="about how long to measure")
    parser.add_argument("--worker", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--fmu", required=True, help=argparse.SUPPRESS)
    options = parser.parse_args()
    bench = Bench(options)
    bench.start()
    bench.measure()
    growth, loop = bench.growth()
    for worker in set(bench.workers.values()):
        worker.end()
    options.out.mkdir(parents=True, exist_ok=True)
    text = report.write(bench, growth, loop, options.out)
    picture.write(bench, options.out / "work-precision.svg")
    print(text)
    bench.say(f"Written: {options.out}/performance.txt, .csv, .md and work-precision.svg")


if __name__ == "__main__":
    main()
