"""Runs commands, keeps their results, and compares them with those kept before (scripts/freeze)."""

import argparse
import csv
import gzip
import json
import math
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VINES = ROOT / "target" / "release" / "vines"
PYTHON = ROOT / ".venv-python" / "bin" / "python"
RECENT = ROOT / "target" / "freeze" / "results.json"
KEPT = ROOT / "validation" / "freeze.json.gz"
NOISE = "--set chain.snr={} --set chain.seed=7"
LEVELS = "--set backbone.points=8"
STRUCTURES = ("cantilever", "resonant", "frame")
SHAKERS = ("shaker-oscillator", "shaker-cantilever", "slip-table")
CAVITIES = ("rough", "skewed", "vertical", "viscoelastic")
SERVED = "vines rig --lock-step --listen 127.0.0.1:{} --sessions 1"
HELIC = "vines rig --protocol helic --listen 127.0.0.1:{} --sessions 1"
PACKED = "vines pack --out fmus"
PROGRAM = """
import json, numpy, vines
cells = vines.sweep(None, {"plant.r": [0.5, 0.65, 0.8], "start.dq2": numpy.linspace(-0.6, 0.7, 3)}, periods=400)
names = ("regime", "impacts_per_period", "recurrence")
print(json.dumps({name: numpy.asarray(cells[name]).tolist() for name in names}))
"""

# Name of a case: commands, of which the last one's results count. A server runs beside the others.
CASES: dict[str, list[str]] = {
    "identify": ["vines identify --json"],
    "identify r=0.7": ["vines identify --json --set plant.r=0.7"],
    "identify from rest": ["vines identify --json --set start.dq2=0"],
    "identify without orbit": ["vines identify --json --set plant.r=0.88"],
    "identify dimensionless": ["vines identify --json --scene scenes/dimensionless.toml"],
    "backbone": ["vines backbone --json"],
    "check": ["vines check --json"],
    "orbit": ["vines orbit --json"],
    "orbit backbone": ["vines orbit --backbone --json --range=-2:0"],
    "orbit response": ["vines orbit --response --json --range=-2:0"],
    "orbit conservative": [
        "vines orbit --backbone --json --range=-2:0 --set plant.c=0 --set plant.r=1 --set excitation.G=0"
    ],
    "orbit of six impacts": ["vines orbit --json --sigma=-0.6 --set excitation.G=2.2"],
    "theory": ["vines theory --json"],
    "map": ["vines map --x sigma=-3:3:13 --y G=0.5:2.5:9 --periods 400 --confirmations 0"],
    "pack": [PACKED],
    "pack structure": ["vines pack --out fmus --scene scenes/cantilever.toml"],
    "controller as FMU": [PACKED, "vines identify --json --controller fmus/PhaseLock.fmu"],
    "rig as FMU": [PACKED, f"vines backbone --json {LEVELS} --rig fmus/LoViNes.fmu"],
    "network": [SERVED, f"vines backbone --json {LEVELS} --rig tcp://127.0.0.1:{{}}"],
    "network, sensors with noise": [
        SERVED + " --sensors-only --set chain.snr=60",
        f"vines backbone --json {LEVELS} --rig tcp://127.0.0.1:{{}}",
    ],
    "network, cable pulled": [
        SERVED + ' --fault "response sensor dead@45"',
        "vines backbone --json --rig tcp://127.0.0.1:{}",
    ],
    "network, clipping amplifier": [
        SERVED + ' --scene scenes/shaker-oscillator.toml --fault "amplifier clips@45"',
        "vines identify --json --scene scenes/shaker-oscillator.toml --rig tcp://127.0.0.1:{}",
    ],
    "helic": [HELIC, "vines check --json --rig helic://127.0.0.1:{}"],
    "fit": [f"vines backbone {LEVELS}", "vines fit out/tracked.csv --json --out rig.toml"],
    "fit record": ["vines backbone --record run.csv " + NOISE.format(60), "vines fit run.csv --json"],
    "fit record 40 dB": ["vines backbone --record run.csv " + NOISE.format(40), "vines fit run.csv --json"],
    "python sweep": [f"{PYTHON} {{program}}"],
    **{f"identify {snr} dB": [f"vines identify --json {NOISE.format(snr)}"] for snr in (60, 40)},
    **{f"backbone {snr} dB": [f"vines backbone --json {LEVELS} {NOISE.format(snr)}"] for snr in (60, 40)},
    **{f"check {snr} dB": [f"vines check --json {NOISE.format(snr)}"] for snr in (60, 40)},
    **{f"identify {name}": [f"vines identify --json --scene scenes/{name}.toml"] for name in STRUCTURES + SHAKERS},
    **{f"backbone {name}": [f"vines backbone --json {LEVELS} --scene scenes/{name}.toml"] for name in STRUCTURES},
    **{f"structure {name}": [f"vines structure --json --scene scenes/{name}.toml"] for name in STRUCTURES},
    **{f"check {name}": [f"vines check --json --scene scenes/{name}.toml"] for name in SHAKERS},
    **{f"identify {name}": [f"vines identify --json --scene scenes/{name}.toml"] for name in CAVITIES},
    **{f"periodic {name}": [f"vines orbit --periodic --json --scene scenes/{name}.toml"] for name in CAVITIES},
}


def number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def table(text: str) -> dict[str, list]:
    head, *rows = csv.reader(text.splitlines() or [""])
    return {name: [number(row[n]) for row in rows if n < len(row)] for n, name in enumerate(head)}


def run(commands: list[str]) -> dict:
    """What the commands of a case write, by file; `exit` and `output` are of the last one."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scenes").symlink_to(ROOT / "scenes")
        (folder / "program.py").write_text(PROGRAM)
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = str(free.getsockname()[1])
        server, done = None, None
        for line in commands:
            line = re.sub(r"^vines\b", str(VINES), line.replace("{program}", "program.py").replace("{}", port))
            if " --listen " in line:
                said = folder / "server.txt"
                with said.open("w") as text:
                    quiet = {"stdout": text, "stderr": text}
                    server = subprocess.Popen(["bash", "-c", "exec " + line], cwd=folder, **quiet)
                while not said.read_text() and server.poll() is None:
                    time.sleep(0.05)
                continue
            done = subprocess.run(["bash", "-c", line], cwd=folder, capture_output=True, text=True, timeout=1800)
        if server:
            server.kill()
            server.wait()
        try:
            output = json.loads(done.stdout)
        except json.JSONDecodeError:
            # Without JSON the words count, not the numbers in them.
            output = re.sub(r"\d+", "#", done.stdout)
        message = re.sub(r"\d[\d.e-]*", "#", done.stderr.splitlines()[-1]) if done.stderr else ""
        kept = {"exit": done.returncode, "output": output, "message": message}
        for file in sorted(folder.rglob("*.csv")):
            # Of samples their number.
            is_table = file.name not in ("run.csv", "interrupted.csv")
            kept[file.name] = table(file.read_text()) if is_table else file.read_text().count("\n")
        for file in sorted(folder.rglob("*.fmu")):
            text = subprocess.run(["unzip", "-p", file, "modelDescription.xml"], capture_output=True, text=True).stdout
            kept[file.name] = text.splitlines()
        return kept


def leaves(value, path=()):
    """Everything that is no list or table, with its path."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, (*path, key))
    elif isinstance(value, list):
        for n, inner in enumerate(value):
            yield from leaves(inner, (*path, n))
    else:
        yield path, value


def uncertainty(flat: dict, path: tuple) -> float | None:
    """The standard uncertainty of a value, which is beside it under its name with `u_`."""
    for n in reversed(range(len(path))):
        if isinstance(path[n], str):
            u = flat.get((*path[:n], f"u_{path[n]}", *path[n + 1 :]))
            return u if isinstance(u, int | float) and u > 0 else None
    return None


def difference(before: dict, now: dict) -> str | None:
    """What differs, in words."""
    old, new = dict(leaves(before)), dict(leaves(now))
    words = [
        f"{'/'.join(map(str, path))}: only {which}"
        for path, which in [(p, "before") for p in old.keys() - new.keys()]
        + [(p, "now") for p in new.keys() - old.keys()]
    ]
    numbers = []
    for path in old.keys() & new.keys():
        one, two = old[path], new[path]
        if isinstance(one, int | float) and isinstance(two, int | float) and not isinstance(one, bool):
            if one != two and not (math.isnan(one) and math.isnan(two)):
                u = uncertainty(old, path)
                numbers.append((abs(two - one) / max(abs(one), abs(two)), abs(two - one) / u if u else None, path))
        elif one != two:
            words.append(f"{'/'.join(map(str, path))}: {one!r} before, {two!r} now")
    if not words and not numbers:
        return None
    text = sorted(words)[:5] + ([f"and {len(words) - 5} more"] if len(words) > 5 else [])
    if numbers:
        relative, _, path = max(numbers, key=lambda row: row[0])
        text.append(f"{len(numbers)} numbers differ, by at most {relative:.1e} of {'/'.join(map(str, path))}")
        stated = [row for row in numbers if row[1] is not None]
        if stated:
            _, over, path = max(stated, key=lambda row: row[1])
            text.append(f"at most {over:.2g} u, of {'/'.join(map(str, path))}")
    return "\n    ".join(text)


def main() -> int:
    parser = argparse.ArgumentParser(prog="scripts/freeze")
    parser.add_argument("--compare", action="store_true")
    parser.add_argument("--keep", action="store_true")
    parser.add_argument("--only", default="", help="part of the names of the cases that are run")
    options = parser.parse_args()
    names = [name for name in CASES if options.only in name]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        results = dict(zip(names, pool.map(run, (CASES[name] for name in names)), strict=True))
    if not options.compare:
        RECENT.parent.mkdir(parents=True, exist_ok=True)
        before = json.loads(RECENT.read_text()) if options.only and RECENT.exists() else {}
        text = json.dumps(before | results)
        if options.keep:
            KEPT.write_bytes(gzip.compress(text.encode(), mtime=0))
        else:
            RECENT.write_text(text)
        codes = {name: result["exit"] for name, result in results.items() if result["exit"]}
        print(f"{len(results)} cases stored; exit codes other than 0: {codes}")
        return 0
    kept = RECENT.read_text() if RECENT.exists() else gzip.decompress(KEPT.read_bytes()).decode()
    before = json.loads(kept)
    # Through JSON, as what is compared with.
    now = json.loads(json.dumps(results))
    differing = {name: difference(before.get(name, {}), now[name]) for name in names}
    for name, words in differing.items():
        if words:
            print(f"{name}:\n    {words}")
    count = sum(words is not None for words in differing.values())
    print(f"{len(names) - count} of {len(names)} cases have equal results")
    return int(count > 0)


if __name__ == "__main__":
    sys.exit(main())
