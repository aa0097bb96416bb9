"""Which faults put into the source do the tests find? A random sample of the mutants of cargo-mutants.

cargo install cargo-mutants --locked
python studies/mutants.py PACKAGE COUNT [MINUTES] [SEED]

PACKAGE is lovines, phase-lock or fmi2-component. The mutants of the package are shuffled by the seed; the first COUNT
of them are put into the working tree one after another, as far as MINUTES allow. The tests run in stages, and the
first that fails ends the mutant. Prints a line for each mutant, and the counts.
"""

import collections
import json
import pathlib
import random
import subprocess
import sys
import time

# The cheapest tests first. The stress tests of the plant are left out: they take longer than all others together.
STAGES = {
    "lovines": [
        "--lib",
        "--test jumps --test trajectories --test shakers --test structures --test variation",
        "--test invariants --test regimes",
    ],
    "phase-lock": ["--lib", "--tests", "-p phase-lock-f32"],
    "fmi2-component": ["--lib", "--tests", "-p fmi2-boundary --test model_exchange"],
}
# A mutant that makes a loop endless is found by time, s. Without a mutant the longest stage takes about 10 s.
TIME = 90


def run(package, stage, *more):
    """The exit code of cargo test; 124 where the time was over, which ends the test's process as well."""
    command = ["timeout", str(600 if more else TIME), "cargo", "test", "--quiet", "-p", package, *stage.split(), *more]
    return subprocess.run(command, capture_output=True, check=False).returncode


def outcome(package):
    """What the tests of a package say of the source as it is."""
    for stage in STAGES[package]:
        if run(package, stage, "--no-run"):
            return "unviable"
        if code := run(package, stage):
            return "timed out" if code == 124 else "caught"
    return "missed"


def main(package, count, minutes=600.0, seed=2026):
    """Tries the first mutants of the shuffled list."""
    end = time.monotonic() + 60 * float(minutes)
    command = ["cargo", "mutants", "--list", "--json", "--diff", "--package", package]
    mutants = json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)
    random.Random(int(seed)).shuffle(mutants)
    if outcome(package) != "missed":
        sys.exit("the tests fail without a mutant")
    counts = collections.Counter()
    for mutant in mutants[: int(count)]:
        if time.monotonic() > end:
            break
        file = pathlib.Path(mutant["file"])
        source = file.read_bytes()
        try:
            subprocess.run(["patch", "--quiet", str(file)], input=mutant["diff"], check=True, text=True)
            result = outcome(package)
        finally:
            file.write_bytes(source)
        counts[result] += 1
        print(f"{result:9} {mutant['name']}", flush=True)
    print(f"{package}: {counts.total()} of {len(mutants)}, {dict(counts)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
