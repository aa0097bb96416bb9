"""The scenes: written by this script, read by all sides.

    python scenes.py --write FOLDER --worker PROGRAM    writes scenes.json and loop.json

All numbers are doubles, and mean exactly that: the truth is worked out for the double nearest to 2 pi, not for 2 pi.
"""

import argparse
import hashlib
import json
import subprocess
from math import pi
from pathlib import Path

EPSILON, LAMBDA, R = 0.0084, 1.43, 0.65
OMEGA = 0.990417
LOOP_PERIODS = 20


def rig(epsilon, damping, r):
    return {"M": 1.0, "k": 1.0, "c": damping, "m": epsilon, "b": 1.0, "r": r}


def driven(amplitude, omega, periods, each=1):
    """So many periods of the drive, with the state asked for after each `each`."""
    step = each * 2 * pi / omega
    return {"amplitude": amplitude, "omega": omega, "step": step, "steps": periods // each, "periods": periods}


def free(periods):
    return {"amplitude": 0.0, "omega": 1.0, "step": 2 * pi, "steps": periods, "periods": periods}


LOCKED = rig(EPSILON, EPSILON * LAMBDA, R)
# On the 1:1 motion, after 1000 periods of the scene `lock` in tests/reference, rounded.
STEADY = [-0.43837155, 0.00769665, -1.00385415, -0.87812325]
# Disturbances of the chaotic motion grow by exp(0.39) per period: by 1e5 in 30 periods. Eleven digits remain.
CHAOTIC_PERIODS = 30


def scenes():
    """Name, what it is, rig, start and drive of each."""
    return {
        "steady": {
            "title": "steady 1:1, 1000 periods",
            **LOCKED,
            "start": STEADY,
            **driven(EPSILON * 1.1, OMEGA, 1000),
        },
        "centre": {
            "title": "steady 1:1 at the linear resonance (sigma = 0, G = 1.2), 200 periods",
            **LOCKED,
            "start": [-0.19261339, -0.13423939, -0.16138338, -0.74405263],
            **driven(EPSILON * 1.2, 1.0, 200),
        },
        "asymmetric": {
            "title": "asymmetric 1:1 (sigma = -1.14, G = 1.5), 200 periods",
            **LOCKED,
            "start": [-0.69173097, 0.18241035, -1.58594360, 0.93666100],
            **driven(EPSILON * 1.5, 0.990424, 200),
        },
        "three": {
            "title": "three impacts per period (sigma = 0, G = 2.5), 200 periods",
            **LOCKED,
            "start": [-0.82181889, -0.62275774, -0.32663444, -1.39999131],
            **driven(EPSILON * 2.5, 1.0, 200),
        },
        "chaotic": {
            "title": f"chaotic (sigma = -1, G = 2.6), {CHAOTIC_PERIODS} periods, in which disturbances grow by 1e5",
            **LOCKED,
            "start": [-1.30395894, 0.48468596, -1.97219916, 0.59318103],
            **driven(EPSILON * 2.6, 0.9916, CHAOTIC_PERIODS),
        },
        "decay": {"title": "transient decay, drive off, 15 periods", **LOCKED, "start": STEADY, **free(15)},
        "grazing": {
            "title": "grazing: the first contact overshoots by 1e-8 of the gap",
            **rig(EPSILON, 0.0, R),
            "start": [0.0, 1.0 + 1e-8, 0.0, 0.0],
            **free(2),
            "step": 2 * pi / 3,
            "periods": 2 / 3,
        },
        "chatter": {
            "title": "chatter into sticking and out of it, 20 periods",
            **rig(0.05, 0.05, 0.4),
            "start": [0.1, 0.0, 0.1, 0.3],
            **driven(1.5, 0.6, 20),
            "sticks": True,
        },
        "long": {
            "title": "long run, 10^5 periods, a state every 1000",
            **LOCKED,
            "start": STEADY,
            **driven(EPSILON * 1.1, OMEGA, 100_000, 1000),
        },
        "damped": {
            "title": "heavy damping (ratio 2), 50 periods",
            **rig(0.05, 4.0, R),
            "start": [0.0, 0.0, -0.5, 1.5],
            **driven(1.0, 1.0, 50),
        },
        "resonance": {
            "title": "undamped resonance, secular growth, 12 periods",
            **rig(0.02, 0.0, 0.6),
            "start": [0.6, 0.0, -0.4, 0.5],
            **driven(0.03, 1.0, 12),
        },
        "loop": {
            "title": f"controller in the loop, 100 samples a period, {LOOP_PERIODS} periods",
            **LOCKED,
            "start": [0.0, 0.0, 0.0, 0.9],
            "amplitude": EPSILON * 1.1,
            "omega": 1.0,
            "step": 2 * pi / 100,
            "steps": 100 * LOOP_PERIODS,
            "periods": LOOP_PERIODS,
            "drives": "loop.json",
        },
    }


def checks(steps):
    """Up to 50 steps after which the state is compared, the last among them."""
    every = max(1, -(-steps // 50))
    return sorted({*range(every, steps + 1, every), steps})


def fingerprint(scene):
    """What the truth of a scene hangs on."""
    kept = {key: scene[key] for key in ("M", "k", "c", "m", "b", "r", "start", "drives", "checks")}
    return hashlib.sha256(json.dumps(kept).encode()).hexdigest()[:16]


def load(file):
    """The scenes with `drives` (amplitude, omega, duration of each step) and `checks`."""
    loaded = json.loads(file.read_text())
    for scene in loaded.values():
        if "drives" in scene:
            drives = json.loads((file.parent / scene["drives"]).read_text())
            scene["drives"] = [(amplitude, omega, scene["step"]) for amplitude, omega in drives]
        else:
            scene["drives"] = [(scene["amplitude"], scene["omega"], scene["step"])] * scene["steps"]
        scene["checks"] = checks(scene["steps"])
        scene.setdefault("sticks", False)
    return loaded


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path, required=True)
    parser.add_argument("--worker", required=True, help="the program vines-benchmarks")
    options = parser.parse_args()
    request = json.dumps({"record": LOOP_PERIODS}) + "\n"
    answer = subprocess.run([options.worker], input=request, capture_output=True, text=True, check=True).stdout
    (options.write / "loop.json").write_text(json.dumps(json.loads(answer)["drives"]).replace("], [", "],\n[") + "\n")
    (options.write / "scenes.json").write_text(json.dumps(scenes(), indent=1) + "\n")


if __name__ == "__main__":
    main()
