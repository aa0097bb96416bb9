"""What the scenes lead to, in 40-digit arithmetic: closed forms between impacts, no code shared with the plant.

    python truth.py SCENES.json -o TRUTH.json     works the scenes out
    python truth.py --check FOLDER                compares itself with the trajectories there (lock, chatter, resonance)

The primary mass's motion is the sum of a particular solution and of exponentials; the particle flies straight on.
Where a wall is reached is looked for twice: in doubles on a grid of 96 points per period of the fastest oscillation,
where an interval is suspicious if the relative motion ends it beyond a wall or turns round in it, and in 40 digits
from there: a turning point is worked out in full before it is said to be an impact or none, and an impact is a Newton
iteration. Chatter is followed impact by impact down to |w'| = 1e-22, with twice the digits, because the rebounds end
in the 45th.
"""

import argparse
import json
import sys
from pathlib import Path

from mpmath import mp, mpf
from rig import DIGITS_IN_CHATTER, Rig

DIGITS = 40


def trajectory(scene, drives, digits=DIGITS, progress=lambda _: None):
    """Rows [index, q1, q1', q2, q2', impacts, stuck] after the steps that are asked for, and the rig at the end."""
    mp.dps = digits
    rig = Rig(scene)
    rows = []
    asked = set(scene["checks"])
    for n, (amplitude, omega, duration) in enumerate(drives, 1):
        rig.drive(amplitude, omega)
        rig.advance(duration)
        if n in asked:
            rows.append([n, *(mp.nstr(x, 25) for x in (rig.q1, rig.v1, rig.q2, rig.v2)), rig.impacts, rig.stuck])
        progress(n)
    return rows, rig


def check(folder):
    """The largest difference from each trajectory in the folder, and from its sticking instants."""
    for file in sorted(folder.glob("*.json")):
        data = json.loads(file.read_text())
        mp.dps = DIGITS_IN_CHATTER if data["sticks"] else DIGITS
        epsilon = mpf(data["eps"])
        scene = {"M": 1, "k": 1, "b": 1, "m": epsilon, "c": epsilon * mpf(data["lam"]), "r": data["r"]}
        scene |= {"start": data["x0"], "checks": range(1, data["n"] + 1)}
        # The steps of the undamped resonance are given to 17 digits: mpf(step) is what was meant.
        drives = [(epsilon * mpf(data["G"]), data["Om"], data["step"])] * data["n"]
        rows, rig = trajectory(scene, drives, mp.dps)
        worst = max(
            abs(mpf(got) - mpf(want))
            for row, reference in zip(rows, data["rows"], strict=True)
            for got, want in zip(row[1:5], reference[1:5], strict=True)
        )
        assert [row[6] for row in rows] == [row[6] for row in data["rows"]]
        sticks = max(
            [abs(mpf(a[1]) - mpf(b[1])) for a, b in zip(rig.events, data["sticks"], strict=True)], default=mpf(0)
        )
        print(
            f"{file.stem}: {rig.impacts} impacts, largest difference {mp.nstr(worst, 2)}, "
            f"of stick and release {mp.nstr(sticks, 2)}"
        )
        if worst > mpf("1e-18") or sticks > mpf("1e-18"):
            sys.exit(f"{file.stem}: more than 1e-18")


def compare(scenes, truth, only):
    """Works scenes out again, and fails where they differ."""
    from scenes import load

    for name, scene in load(scenes).items():
        if name in only:
            digits = DIGITS_IN_CHATTER if scene["sticks"] else DIGITS
            rows, rig = trajectory(scene, scene["drives"], digits)
            if (rows, rig.events, rig.impacts) != tuple(truth[name][key] for key in ("rows", "events", "impacts")):
                sys.exit(f"{name}: not what the file says")
            print(f"{name}: {rig.impacts} impacts, the same again")


def main():
    parser = argparse.ArgumentParser(description="The scenes in 40-digit arithmetic.")
    parser.add_argument("scenes", nargs="?", type=Path)
    parser.add_argument("-o", dest="out", type=Path)
    parser.add_argument("--only", nargs="+", help="these scenes alone; the others stay as they are in the file")
    parser.add_argument("--compare", type=Path, help="a file of truths that should come out again; nothing is written")
    parser.add_argument("--check", type=Path, help="a folder of trajectories to be checked against")
    options = parser.parse_args()
    if options.check:
        check(options.check)
    if not options.scenes:
        return
    from scenes import fingerprint, load

    if options.compare:
        compare(options.scenes, json.loads(options.compare.read_text()), options.only)
        return
    truth = json.loads(options.out.read_text()) if options.out.exists() else {}
    for name, scene in load(options.scenes).items():
        if options.only and name not in options.only:
            continue
        digits = DIGITS_IN_CHATTER if scene["sticks"] else DIGITS
        total = len(scene["drives"])

        def progress(n, name=name, total=total):
            if sys.stderr.isatty() and n % max(1, total // 100) == 0:
                print(f"\r{name}: {n} of {total}", end="", file=sys.stderr, flush=True)

        rows, rig = trajectory(scene, scene["drives"], digits, progress)
        # How a change of the start in its 16th digit would grow: the least error that doubles can be asked for.
        moved = scene | {"start": [repr(float(x) * (1 + 1e-13)) for x in scene["start"]]}
        sensitivity = None
        if scene["periods"] <= 1000:
            others, _ = trajectory(moved, scene["drives"], digits)
            change = max(
                abs(mpf(a) - mpf(b))
                for x, y in zip(rows, others, strict=True)
                for a, b in zip(x[1:5], y[1:5], strict=True)
            )
            sensitivity = float(mp.nstr(change / mpf("1e-13"), 3))
        truth[name] = {"impacts": rig.impacts, "events": rig.events, "sensitivity": sensitivity, "rows": rows}
        truth[name] = {"of": fingerprint(scene)} | truth[name]
        print(f"{name}: {rig.impacts} impacts, sensitivity {sensitivity}, {rig.events[:4]}")
        part = options.out.with_suffix(".part")
        part.write_text(json.dumps(truth, indent=0) + "\n")
        part.replace(options.out)


if __name__ == "__main__":
    main()
