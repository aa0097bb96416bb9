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
from math import inf
from pathlib import Path

from motion import Motion, Oscillator, bisected, newton
from mpmath import mp, mpf

DIGITS = 40
DIGITS_IN_CHATTER = 90
LEAST_VELOCITY = "1e-22"
POINTS_PER_PERIOD = 96


class Rig:
    """The rig, its state, and the clock."""

    def __init__(self, scene):
        number = {key: mpf(scene[key]) for key in ("M", "k", "c", "m", "b", "r")}
        self.m_primary, self.m, self.b, self.r = number["M"], number["m"], number["b"], number["r"]
        self.alone = Oscillator(number["M"], number["c"], number["k"])
        self.joint = Oscillator(number["M"] + number["m"], number["c"], number["k"])
        self.q1, self.v1, self.q2, self.v2 = (mpf(x) for x in scene["start"])
        self.time, self.phase = mpf(0), mpf(0)
        self.stuck = 0
        self.wall = 0  # touched at this very instant
        self.impacts = 0
        self.events = []
        self.amplitude = self.omega = mpf(0)

    def drive(self, amplitude, omega):
        amplitude = mpf(amplitude)
        if self.amplitude != amplitude and self.time > 0:
            self.v1 += self.alone.c / self.m_primary * (amplitude - self.amplitude) * mp.sin(self.phase)
        self.amplitude, self.omega = amplitude, mpf(omega)

    def advance(self, duration):
        left = mpf(duration)
        while left > 0:
            left = self.stay(left) if self.stuck else self.fly(left)

    def pass_by(self, t):
        self.time += t
        self.phase = (self.phase + self.omega * t) % (2 * mp.pi)

    def motion(self, oscillator):
        return Motion(oscillator, self.q1, self.v1, self.amplitude, self.omega, self.phase)

    def grid(self, left):
        fastest = max(float(self.omega), max(abs(complex(s)) for s in self.alone.roots()), 1e-3)
        step = 6.283185307179586 / fastest / POINTS_PER_PERIOD
        t, end = 0.0, float(left)
        while t < end:
            after = min(t + step, end)
            yield t, after
            t = after

    def fly(self, left):
        motion = self.motion(self.alone)
        t, wall = self.first_contact(motion, left)
        self.q1, self.v1 = motion.at(t, 0), motion.at(t, 1)
        self.q2 += self.v2 * t
        self.pass_by(t)
        self.wall = wall
        if wall:
            self.q2 = self.q1 - wall * self.b
            self.strike(wall)
        return left - t

    def strike(self, wall):
        before = self.v1 - self.v2
        momentum = self.m_primary * self.v1 + self.m * self.v2
        total = self.m_primary + self.m
        self.v1 = (momentum - self.m * self.r * before) / total
        self.v2 = self.v1 + self.r * before
        self.impacts += 1
        if abs(before) < mpf(LEAST_VELOCITY):
            self.v1 = self.v2 = momentum / total
            self.stuck, self.wall = wall, 0
            self.events.append(["stick", mp.nstr(self.time, 22)])

    def stay(self, left):
        """Both move as one while the wall pushes: wall * q'' > 0."""
        motion, wall = self.motion(self.joint), self.stuck

        def push(t):
            return wall * motion.at(t, 2)

        found = None
        for low, high in self.grid(left):
            if wall * motion.near(high, 2) <= 0:
                found = newton(push, lambda t: wall * motion.at(t, 3), sum(bisected(push, mpf(low), mpf(high), 30)) / 2)
                break
        t = left if found is None or found >= left else found
        self.q1, self.v1 = motion.at(t, 0), motion.at(t, 1)
        self.q2, self.v2 = self.q1 - wall * self.b, self.v1
        self.pass_by(t)
        if t is found:
            self.stuck, self.wall = 0, wall
            self.events.append(["release", mp.nstr(self.time, 22)])
        return left - t

    def first_contact(self, motion, left):
        """When and at which wall (0: none within what is left)."""
        start = self.wall and self.wall * (self.v1 - self.v2)
        if self.wall and start < 0 and -start < mpf("1e-3"):
            hop = self.hop(motion)
            if hop is not None:
                return (hop, self.wall) if hop <= left else (left, 0)

        def gap(t, wall):
            return self.b - wall * (motion.at(t, 0) - self.q2 - self.v2 * t)

        def closing(t, wall):
            return wall * (motion.at(t, 1) - self.v2)

        q2, v2, b = float(self.q2), float(self.v2), float(self.b)
        v_high = float(self.v1)
        for low, high in self.grid(left):
            v_low = v_high
            x, v = motion.both_near(high)
            v_high = v
            found = (inf, 0)
            for wall in (1, -1):
                lowest = b - wall * (x - q2 - v2 * high)
                turns = wall * (v_low - v2) > 0 > wall * (v - v2)
                beyond = mpf(high)
                if turns and lowest > 0:
                    # The relative motion turns round in here: is it beyond the wall where it does?
                    most = (v_low - v2) ** 2 / max(1e-300, abs(v_low - v))
                    if lowest > 10 * most * (high - low) + 10 * abs(v - v2) * (high - low):
                        continue
                    around = bisected(lambda t: closing(t, wall), mpf(low), mpf(high), 20)  # noqa: B023
                    beyond = newton(lambda t: closing(t, wall), lambda t: wall * motion.at(t, 2), sum(around) / 2)  # noqa: B023
                    if gap(beyond, wall) > 0:
                        continue
                elif lowest > 0:
                    continue
                # The gap closes between low and beyond; at low it is open, or just left with the gap opening.
                floor = mpf(low)
                if low == 0.0 and self.wall == wall:
                    floor = self.departure(gap, beyond, wall)
                if min(wall * (v_low - v2), wall * (v - v2)) > 0.1:
                    # A clear approach: doubles are enough to begin with.
                    around = bisected(lambda t: b - wall * (motion.near(t, 0) - q2 - v2 * t), float(floor), high, 30)  # noqa: B023
                else:
                    around = bisected(lambda t: gap(t, wall), floor, beyond, 42)  # noqa: B023
                t = newton(lambda t: gap(t, wall), lambda t: -closing(t, wall), mpf(sum(around)) / 2)  # noqa: B023
                if t < found[0]:
                    found = (t, wall)
            if found[1]:
                return found if found[0] <= left else (left, 0)
        return left, 0

    @staticmethod
    def departure(gap, beyond, wall):
        """A time after the start at which the particle has left the wall that it starts on."""
        t = beyond / 2
        for _ in range(100):
            if gap(t, wall) > 0:
                return t
            t /= 2
        raise ArithmeticError("the particle does not leave the wall that it starts on")

    def hop(self, motion):
        """The end of a low rebound, in which the acceleration hardly changes: the root of gap(t)/t."""
        with mp.workdps(DIGITS_IN_CHATTER):
            wall = self.wall
            speed = -wall * (self.v1 - self.v2)
            push, change = wall * motion.at(0, 2), wall * motion.at(0, 3)
            if push <= 0:
                return None
            guess = 2 * speed / push
            if abs(change) * guess > push / 10:
                return None

            def gap_per_time(t):
                return (-wall * (motion.at(t, 0) - self.q1 - self.v2 * t)) / t

            def slope(t):
                return -wall * (motion.at(t, 1) - self.v2) / t - gap_per_time(t) / t

            return newton(gap_per_time, slope, guess)


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
