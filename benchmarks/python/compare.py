"""Run time against error: this plant and what a user would otherwise pick, on the same scenes, in one run.

Methods in Rust, Brent's among them, take turns of two milliseconds with the plant in one process: time/plant is the
median of the ratios of all pairs of turns, with their quartiles. Other methods run in processes of their own.
Started by scripts/bench, which builds and installs what is needed.
"""

import argparse
import json
import random
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

import report
import run_time_map
from measured import Load, Row, judge, middle_point
from scenes import LOOP_PERIODS, fingerprint, load
from worker import Missing, Worker

HERE = Path(__file__).resolve().parent.parent
# Where `--keep` puts what a full run writes.
KEPT = {
    "performance.txt": "validation",
    "performance.csv": "validation",
    "run_time_map.csv": "validation",
    "run-time-map.svg": "validation",
    "work-precision.svg": "docs",
}
TOLERANCES = (1e-6, 1e-9, 1e-12)
COARSE = (1e-4, 1e-6, 1e-9)
STEPS = (100, 1000, 10000)

# Name in the tables, side, name there, settings, those of a quick run.
METHODS = [
    ("plant, Rust", "rust", "plant", (0,), (0,)),
    ("plant, one step in all", "rust", "plant-one-step", (0,), (0,)),
    ("plant, 100 times the steps", "rust", "plant-100", (0,), ()),
    ("plant, plain solver only", "rust", "plant-general", (0,), (0,)),
    ("plant, C interface", "rust", "c-interface", (0,), (0,)),
    ("plant, FMPy", "python", "fmpy", (0,), (0,)),
    ("closed form + Brent", "rust", "brent", TOLERANCES, (1e-9, 1e-12)),
    ("heyoka", "python", "heyoka", (1e-9, 1e-12, 1e-15), (1e-9, 1e-15)),
    ("diffsol, Tsit45", "rust", "diffsol-tsit45", TOLERANCES, (1e-6, 1e-9)),
    ("diffsol, BDF", "rust", "diffsol-bdf", COARSE, ()),
    ("CVODE in C", "c", "cvode-c", TOLERANCES, (1e-9, 1e-12)),
    ("CVODE, Adams", "python", "cvode", TOLERANCES, (1e-9,)),
    ("scipy DOP853", "python", "scipy-dop853", TOLERANCES, (1e-9,)),
    ("scipy LSODA", "python", "scipy-lsoda", TOLERANCES, (1e-9,)),
    ("scipy Radau", "python", "scipy-radau", COARSE, ()),
    ("RK4 + bisection", "rust", "rk4", STEPS, (100, 1000)),
    ("Moreau time-stepping", "rust", "moreau", STEPS, (100, 1000)),
]
ROUNDS = 5
QUICK = ("steady", "centre", "grazing", "chatter", "loop")
# Scenes whose truth takes longer to work out than a run of this program should: a quick run takes all from the file.
KEPT_TRUTH = ("long",)
GROWTH = {
    "periods": (1e6, 1e4),
    "impacts": (1e7, 1e5),
    "samples per period": (1e4, 1e3),
}


class Bench:
    """Workers, scenes, truth, rows."""

    def __init__(self, options):
        self.options = options
        self.scenes = load(HERE / "scenes.json")
        self.truth = json.loads((HERE / "truth.json").read_text())
        self.limit = 1.5 if options.quick else 8.0
        self.budget = 0.1
        self.workers, self.missing, self.versions, self.unasked = {}, {}, [], []
        self.rows, self.truth_notes = [], []
        self.rounds, self.busy = 0, 0.0
        self.told = time.monotonic()

    def say(self, text):
        print(text, file=sys.stderr, flush=True)

    def progress(self, text):
        """In one line where somebody watches; else a line every ten seconds."""
        if sys.stderr.isatty():
            print(f"\r{text:100.100}", end="", file=sys.stderr, flush=True)
        elif time.monotonic() - self.told > 10:
            self.told = time.monotonic()
            self.say(text)

    def check_truth(self):
        """That the truth is of these scenes, that its script leads where the reference trajectories do, and, but for a
        quick run, that it comes out again."""
        for name, scene in self.scenes.items():
            if self.truth.get(name, {}).get("of") != fingerprint(scene):
                sys.exit(
                    f"error: benchmarks/truth.json is not of the scene {name}: scripts/bench --truth works it out anew"
                )
        script = [sys.executable, HERE / "python/truth.py", "--check", HERE.parent / "tests/reference/trajectories"]
        if not self.options.quick:
            again = [name for name in self.scenes if name not in KEPT_TRUTH]
            script += [HERE / "scenes.json", "--compare", HERE / "truth.json", "--only", *again]
        self.say("Checking the truth ...")
        done = subprocess.run([str(part) for part in script], capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"error: the truth does not hold: {done.stdout}{done.stderr}")
        self.truth_notes = done.stdout.strip().splitlines()
        for line in self.truth_notes:
            self.say(f"  {line}")

    def start(self):
        rust = Worker([self.options.worker, HERE], greets=False)
        known = rust.ask({"methods": True}, 60)
        self.rust = rust
        scenes = [s for s in self.scenes if not self.options.quick or s in QUICK]
        for method, side, name, settings, quick in METHODS:
            if self.options.quick:
                settings = quick
            if not settings:
                self.unasked.append(method)
                continue
            if side == "rust":
                if name not in known:
                    self.missing[method] = "not in this build"
                    continue
                self.workers[name] = rust
            else:
                command = self.peer_command(side, name)
                try:
                    self.workers[name] = Worker(command, greets=True)
                except Missing as why:
                    self.missing[method] = str(why)
                    continue
                self.versions.append(self.workers[name].hello["version"])
            self.rows += [Row(scene, method, side, name, setting) for scene in scenes for setting in settings]
        for method, why in self.missing.items():
            self.say(f"warning: {method} is left out: {why}")
        self.rehearse()

    def peer_command(self, side, name):
        if side == "c":
            return [
                sys.executable,
                HERE / "python/cvode_c.py",
                HERE / "scenes.json",
                HERE.parent / "out/bench/programs",
            ]
        return [sys.executable, HERE / "python/peers.py", name, HERE / "scenes.json", self.options.fmu]

    def rehearse(self):
        """Loads and compiles what will be needed: that is not in the times."""
        for row in self.rows:
            if row.name in ("c-interface", "heyoka"):
                self.progress(f"preparing {row.name}: {row.scene}")
                request = {"scene": row.scene, "method": row.name, "setting": row.setting, "checks": [1]}
                self.workers[row.name].ask(request | {"budget": 0.0, "limit": 0.01}, 600)

    def run(self, row):
        scene = self.scenes[row.scene]
        checks = scene["checks"]
        if row.name.endswith("one-step"):
            if row.scene == "loop":
                row.failure = "not asked: the drive changes with every sample"
                return
            checks = checks[-1:]
        request = {"scene": row.scene, "method": row.name, "setting": row.setting, "checks": checks}
        if row.name.endswith("one-step"):
            request["checks"] = []
        patience = 4 * self.limit + 30
        answer = self.workers[row.name].ask(request | {"budget": self.budget, "limit": self.limit}, patience)
        ended = answer and not answer.get("error") and not answer.get("failure")
        if row.times and not ended:
            return  # It has come to an end before; this time something else kept the machine busy.
        if answer is None:
            row.failure = f"hung: killed after {patience:g} s"
        elif not ended:
            row.failure = answer.get("error") or answer["failure"]
        else:
            row.times.append(statistics.median(answer["ns"]))
            row.ratios += [ns / plant for ns, plant in zip(answer["ns"], answer.get("plant_ns", ()), strict=False)]
            if row.error is None:
                row.impacts = answer["impacts"]
                row.error, row.failure = judge(row.name, scene, self.truth[row.scene], answer, checks)

    def measure(self):
        """Round after round, in an order drawn anew each time. Every row that comes to an end is in every round."""
        began = time.monotonic()
        total = self.options.seconds or (45 if self.options.quick else 1250)
        last = 0.0
        dice = random.Random(1)
        load = Load(set(self.workers.values()))
        for turn in range(1, ROUNDS + 1):
            gone = time.monotonic() - began
            if turn > 3 and gone + last > total:
                break  # The next round would end too late.
            start_of_round = gone
            order = [row for row in self.rows if not row.given_up()]
            dice.shuffle(order)
            for n, row in enumerate(order, 1):
                gone = time.monotonic() - began
                self.progress(
                    f"round {turn}: {n} of {len(order)}, {gone:.0f} s, {row.scene}: {row.method} {row.setting:g}"
                )
                self.run(row)
            self.rounds, last = turn, time.monotonic() - began - start_of_round
        self.busy = load.others()
        self.progress("")
        self.say(f"Measured for {time.monotonic() - began:.0f} s, {self.rounds} rounds")

    def growth(self):
        """What grows: points of size, ns, units of work; and ns per sample of plant and controller."""
        curves = {what: [] for what in GROWTH}
        for turn in range(1, 4):
            for what, (most, quick) in GROWTH.items():
                self.progress(f"growth, round {turn}: {what}")
                request = {"growth": what, "budget": 0.02, "most": quick if self.options.quick else most}
                answer = self.rust.ask(request, 200) or {}
                curves[what].append(answer.get("points", []))
        middle = {what: [middle_point(same) for same in zip(*turns, strict=False)] for what, turns in curves.items()}
        loop = self.rust.ask({"closed_loop": LOOP_PERIODS, "budget": 0.2 if self.options.quick else 2.0}, 60)
        return middle, loop["ns"]

    def map_points(self):
        return run_time_map.QUICK_POINTS if self.options.quick else run_time_map.POINTS


def only_map(options):
    """The map of run time without the rest."""
    worker = Worker([options.worker, HERE], greets=False)
    load = Load({worker})
    points = run_time_map.QUICK_POINTS if options.quick else run_time_map.POINTS
    watched = sys.stderr.isatty()
    progress = (
        (lambda text: print(f"\r{text} ", end="", file=sys.stderr, flush=True)) if watched else lambda _text: None
    )
    rows, lock = run_time_map.measure(worker, points, progress)
    busy = load.others()
    worker.end()
    options.out.mkdir(parents=True, exist_ok=True)
    run_time_map.write(rows, lock, options.out)
    print(f"\r{run_time_map.as_text(rows, lock)}" if watched else run_time_map.as_text(rows, lock))
    print(report.idle(busy))
    print(f"Written: {options.out}/run_time_map.csv and run-time-map.svg", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(
        prog="scripts/bench",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="scripts/bench --truth works benchmarks/truth.json out anew, in a quarter of an hour.",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help=f"five scenes ({', '.join(QUICK)}), one or two settings of a method; under two minutes",
    )
    parser.add_argument(
        "--keep",
        action="store_true",
        help="renew the results in validation/, docs/work-precision.svg and the table in docs/benchmarks.md",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out/bench"), help="folder for tables and figure (default %(default)s)"
    )
    parser.add_argument("--seconds", type=float, help="about how long to measure; there are three rounds at least")
    parser.add_argument("--map", action="store_true", help="only the map of run time: figure, CSV and table per regime")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    parser.add_argument("--fmu", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.keep and options.quick:
        parser.error("--keep is for a full run: it renews what docs/ says of all scenes")
    if options.map:
        only_map(options)
        return
    began = time.monotonic()
    bench = Bench(options)
    bench.check_truth()
    bench.start()
    bench.measure()
    growth, loop = bench.growth()
    rows, lock = run_time_map.measure(bench.rust, bench.map_points(), bench.progress)
    for worker in set(bench.workers.values()):
        worker.end()
    import figure  # Here, so that --help needs nothing installed.

    options.out.mkdir(parents=True, exist_ok=True)
    run_time_map.write(rows, lock, options.out)
    print(report.write(bench, growth, loop, (rows, lock), options.out))
    figure.write(bench, options.out / "work-precision.svg")
    if options.keep:
        root = HERE.parent
        for name, folder in KEPT.items():
            shutil.copy(options.out / name, root / folder / name)
        report.renew(root / "docs/benchmarks.md", bench)
    bench.say(f"Written: {', '.join(KEPT)} in {options.out}, after {time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
