"""Reference trajectories of a real cavity, in 40-digit arithmetic: python tests/reference/cavity.py

Writes tests/reference/cavity.csv. Nothing is shared with the plant: one complex exponential per oscillator,
events by scanning in small steps and bisection, every sign change of a derivative examined for a contact between
two scans.
"""

from math import sqrt as fsqrt
from pathlib import Path

from mpmath import cos, exp, im, mp, mpc, mpf, re, sin, sqrt

mp.dps = 40
FILE = Path(__file__).with_suffix(".csv")
STEPS = 1000
ROWS = [1, 2, 5, 10, 20, 50, 100, 200, 300, 400, 500, 600, 700, 800, 900, 1000]
# The published rig (kg, N/m, N s/m, m); numbers are those of the plant: the nearest doubles.
RIG = {
    "M": 3.807,
    "k": 11680.0,
    "c": 2.53,
    "m": 0.032,
    "b_plus": 0.01,
    "b_minus": 0.01,
    "r_plus": 0.65,
    "r_minus": 0.65,
}
# Steady 1:1 motion of the ideal cavity at G = 1.1.
LOCK = {
    "E": 9.246e-05,
    "omega": 54.858,
    "q1": -0.004384,
    "dq1": 0.00426,
    "q2": -0.010039,
    "dq2": -0.4864,
    "step": 0.0035,
}
SCENES = {
    "sliding": {"b_plus": 0.2, "b_minus": 0.2, "mu_k": 0.05, "q1": 0.003, "dq2": 0.3, "step": 0.0008},
    "stick_slip": {
        "b_plus": 0.05,
        "b_minus": 0.05,
        "mu_k": 0.5,
        "mu_s": 0.8,
        "E": 0.0008,
        "omega": 50.0,
        "step": 0.0005,
    },
    "lower_wall": {"theta": 0.5, "E": 0.0003, "omega": 50.0, "q2": 0.01, "step": 0.0004},
    "chatter": {"theta": 1.2, "r_plus": 0.5, "r_minus": 0.5, "E": 0.0005, "omega": 49.0, "step": 0.0004},
    # The reversal at 0.4147 s is 1e-6 gaps before the wall.
    "reversal": {"b_plus": 0.00843849457258584, "mu_k": 0.2, "E": 0.0008, "omega": 50.0, "dq2": 0.05, "step": 0.0006},
    "crest": {"c": 0.0, "mu_k": 0.3, "mu_s": 0.31, "E": 0.0, "dq1": 0.05512, "dq2": 0.05512, "step": 0.0003},
    "friction": {**LOCK, "mu_k": 0.05},
    "vertical": {**LOCK, "theta": 1.5707963267948966, "E": 0.0003},
    "skewed": {**LOCK, "b_plus": 0.011, "b_minus": 0.009, "r_minus": 0.6},
    "viscoelastic": {**LOCK, "law": "viscoelastic", "r_plus": 0.35, "r_minus": 0.35},
    "plastic": {**LOCK, "law": "plastic", "r_plus": 0.08, "r_minus": 0.1, "r_min": 0.3},
    "scatter": {**LOCK, "scatter": 0.05, "seed": 7},
    "all": {
        "b_plus": 0.0105, "b_minus": 0.0095, "theta": 0.05, "mu_k": 0.1, "mu_s": 0.15, "law": "viscoelastic",
        "r_plus": 0.35, "r_minus": 0.3, "r_min": 0.2, "scatter": 0.02, "seed": 11,
        "E": 0.0003, "omega": 54.0, "step": 0.0025,
    },
}  # fmt: skip
DEFAULTS = {
    **RIG, "law": "constant", "r_min": 0.0, "theta": 0.0, "mu_k": 0.0, "scatter": 0.0, "seed": 0,
    "E": 0.0, "omega": 0.0, "q1": 0.0, "dq1": 0.0, "q2": 0.0, "dq2": 0.0,
}  # fmt: skip


def deviate(seed, counter):
    """A deviate in double precision: the sum of eight numbers of 16 bits from SplitMix64 with a counter."""
    mask, gamma = (1 << 64) - 1, 0x9E3779B97F4A7C15

    def mix(z):
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & mask
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB & mask
        return z ^ (z >> 31)

    start = mix((seed + gamma) & mask)
    outputs = [mix((start + gamma * (2 * counter + n)) & mask) for n in (1, 2)]
    total = sum(z >> shift & 0xFFFF for z in outputs for shift in (0, 16, 32, 48))
    return (total - 4 * 0xFFFF) / fsqrt(8 * (65536.0**2 - 1) / 12)


class Oscillator:
    """The motion of a mass on spring and damper under the harmonic base and a constant force, from a start."""

    def __init__(self, scene, mass, force, t, x, v):
        k, c, self.omega = scene["k"], scene["c"], scene["omega"]
        self.t, self.rest = t, force / k
        delta = c / (2 * mass)
        self.exponent = mpc(-delta, sqrt(k / mass - delta**2))
        # The steady response to E e^{i omega t}; the displacement is the imaginary part.
        w = self.omega
        self.steady = scene["E"] * mpc(k, c * w) / mpc(k - mass * w**2, c * w)
        turned = self.steady * exp(mpc(0, w * t))
        y, dy = x - self.rest - im(turned), v - re(turned) * w
        # y(t) = Re(a e^{exponent t}).
        self.free = mpc(y, -(dy + delta * y) / im(self.exponent))

    def at(self, t):
        """Displacement, velocity and acceleration."""
        free = self.free * exp(self.exponent * (t - self.t))
        turned = self.steady * exp(mpc(0, self.omega * t))
        w = self.omega
        return (
            self.rest + re(free) + im(turned),
            re(free * self.exponent) + w * re(turned),
            re(free * self.exponent**2) - w**2 * im(turned),
        )


def root(function, a, b):
    """The sign change of `function` in [a, b]: bisection, then the Illinois method."""
    fa, fb = function(a), function(b)
    for _ in range(8):
        middle = (a + b) / 2
        value = function(middle)
        if (value > 0) == (fa > 0):
            a, fa = middle, value
        else:
            b, fb = middle, value
    side = 0
    for _ in range(200):
        middle = (a * fb - b * fa) / (fb - fa) if fb != fa else (a + b) / 2
        value = function(middle)
        if abs(b - a) < mpf(10) ** -36 or value == 0:
            return middle
        if (value > 0) == (fa > 0):
            if side == 1:
                fb /= 2
            a, fa, side = middle, value, 1
        else:
            if side == -1:
                fa /= 2
            b, fb, side = middle, value, -1
        if abs(value) < mpf(10) ** -37:
            return middle
    return middle


class Rig:
    """Both masses from event to event."""

    def __init__(self, given):
        self.p = {
            key: mpf(value) if isinstance(value, float) else value for key, value in {**DEFAULTS, **given}.items()
        }
        p = self.p
        gravity = mpf(9.80665)
        normal = gravity * cos(p["theta"]) if abs(p["theta"]) < 1.5 else mpf(0)
        self.a_g, self.kinetic = gravity * sin(p["theta"]), p["mu_k"] * normal
        self.holding = p.get("mu_s", p["mu_k"]) * normal
        self.t = mpf(0)
        self.q1, self.dq1, self.q2, self.dq2 = (p[key] for key in ("q1", "dq1", "q2", "dq2"))
        self.mode = None
        self.impacts = self.sticks = 0
        self.friction = self.stuck_time = mpf(0)
        self.scan = 1 / sqrt(p["k"] / p["M"]) / 60

    def gap(self, wall, w):
        return self.p["b_plus"] - w if wall > 0 else self.p["b_minus"] + w

    def needed(self, dq1=None):
        """Acceleration that the particle needs beyond gravity to follow the primary mass."""
        both = self.both(dq1)
        return both.at(self.t)[2] - self.a_g

    def both(self, dq1=None):
        """The primary mass with the particle, at the velocity `dq1`."""
        p = self.p
        return Oscillator(p, p["M"] + p["m"], p["m"] * self.a_g, self.t, self.q1, self.dq1 if dq1 is None else dq1)

    def alone(self, force):
        """The primary mass alone under a constant force."""
        return Oscillator(self.p, self.p["M"], force, self.t, self.q1, self.dq1)

    def follow(self, motion):
        """Takes over what a motion has reached."""
        self.q1, self.dq1, _ = motion.at(self.t)

    def kick(self, velocity):
        """An impulse at the cavity."""
        self.dq1 += velocity

    def decide(self):
        """What the particle does from now on: ("held", wall or 0) or ("slide", direction)."""
        w, dw = self.q1 - self.q2, self.dq1 - self.dq2
        for wall in (1, -1):
            if self.gap(wall, w) < mpf(10) ** -30 and wall * dw >= 0 and wall * self.needed() >= -self.holding:
                return "held", wall
        if self.holding == 0:
            return "slide", 0
        if dw != 0:
            return "slide", 1 if dw > 0 else -1
        needed = self.needed()
        if abs(needed) <= self.holding:
            return "held", 0
        return "slide", 1 if needed > 0 else -1

    def scan_for(self, functions, limit, first):
        """The first time at which one of `functions` (value and derivative) falls below 0, and which."""
        before, h = None, min(first, self.scan)
        a = self.t
        while a < limit:
            b = min(a + h, limit)
            now = [f(b) for f in functions]
            hits = []
            for n, f in enumerate(functions):
                value, slope = now[n]
                if value < 0:
                    start = a
                    if before is None:
                        # The start itself may be a zero: find a positive instant behind it.
                        start = b
                        for _ in range(200):
                            start = self.t + (start - self.t) / 2
                            if f(start)[0] > 0:
                                break
                        else:
                            return self.t, n
                    hits.append((root(lambda t, f=f: f(t)[0], start, b), n))
                elif before is not None and before[n][1] < 0 < slope:
                    lowest = root(lambda t, f=f: f(t)[1], a, b)
                    if f(lowest)[0] < 0:
                        hits.append((root(lambda t, f=f: f(t)[0], a, lowest), n))
            if hits:
                return min(hits)
            a, before, h = b, now, min(2 * h, self.scan)
        return limit, None

    def advance(self, limit):
        while self.t < limit:
            kind, which = self.mode or self.decide()
            if kind == "held":
                self.hold(which, limit)
            else:
                self.slide(which, limit)

    def hold(self, which, limit):
        """The masses move as one: at the wall `which`, or in mid-cavity for 0."""
        if which == 0 and self.mode is None:
            self.sticks += 1
        self.mode = ("held", which)
        both = self.both()
        offset, began = self.q1 - self.q2, self.t
        directions = (-which,) if which else (1, -1)

        def spare(direction):
            def function(t):
                h = mpf(10) ** -12
                n, later = both.at(t)[2] - self.a_g, both.at(t + h)[2] - self.a_g
                return self.holding - direction * n, -direction * (later - n) / h

            return function

        self.t, hit = self.scan_for([spare(d) for d in directions], limit, self.scan)
        self.follow(both)
        self.q2, self.dq2 = self.q1 - offset, self.dq1
        if which == 0:
            self.stuck_time += self.t - began
        if hit is not None:
            self.mode = ("slide", directions[hit]) if self.holding else ("slide", 0)

    def slide(self, which, limit):
        """The particle slides in the direction `which` of w', or flies without friction."""
        p = self.p
        # The force that began the sliding decides the direction once only.
        self.mode = None
        friction = which * self.kinetic
        alone = self.alone(-p["m"] * friction)
        pull, t0, q2, dq2, w0 = self.a_g + friction, self.t, self.q2, self.dq2, self.q1 - self.q2

        def relative(t):
            x, v, a = alone.at(t)
            s = t - t0
            return x - (q2 + s * (dq2 + s * pull / 2)), v - (dq2 + s * pull), a - pull

        def to_wall(wall):
            def function(t):
                w, dw, _ = relative(t)
                return self.gap(wall, w), -wall * dw

            return function

        def to_reversal(t):
            _, dw, ddw = relative(t)
            return which * dw, which * ddw

        walls = (which,) if which else (1, -1)
        functions = [to_wall(wall) for wall in walls] + ([to_reversal] if which else [])
        _, dw, ddw = relative(t0)
        first = abs(dw / ddw) / 8 if ddw != 0 and dw != 0 else self.scan / 4
        self.t, hit = self.scan_for(functions, limit, first)
        self.follow(alone)
        s = self.t - t0
        self.q2, self.dq2 = q2 + s * (dq2 + s * pull / 2), dq2 + s * pull
        self.friction += p["m"] * self.kinetic * abs(self.q1 - self.q2 - w0)
        if hit is None:
            self.mode = ("slide", which)
        elif hit < len(walls):
            self.impact(walls[hit])
        else:
            self.dq2 = self.dq1

    def restitution(self, wall, v):
        p = self.p
        value = p["r_plus"] if wall > 0 else p["r_minus"]
        if p["law"] == "viscoelastic":
            value = 1 - value * v ** (mpf(1) / 5)
        elif p["law"] == "plastic":
            value = (value / v) ** (mpf(1) / 4)
        value = max(p["r_min"], min(mpf(1), value))
        if p["scatter"]:
            value *= 1 + p["scatter"] * mpf(deviate(p["seed"], self.impacts))
        return max(p["r_min"], min(mpf(1), value))

    def impact(self, wall):
        p = self.p
        self.q2 = self.q1 - (p["b_plus"] if wall > 0 else -p["b_minus"])
        dw = self.dq1 - self.dq2
        r = self.restitution(wall, abs(dw))
        self.impacts += 1
        # A hop of 1e-26 m is at rest: the reference ends a chatter there.
        rebound = r * abs(dw)
        fraction = p["m"] / (p["M"] + p["m"])
        momentum = self.dq1 - fraction * dw
        pressing = wall * self.needed(momentum) * (1 + p["m"] / p["M"]) + (1 + p["m"] / p["M"]) * self.kinetic
        if pressing > 0 and rebound**2 / (2 * pressing) < mpf(10) ** -26:
            self.kick(momentum - self.dq1)
            self.dq2 = self.dq1
            if wall * self.needed() >= -self.holding:
                self.mode = ("held", wall)
            return
        self.kick(-(1 + r) * fraction * dw)
        self.dq2 = self.dq1 + r * dw


def main():
    lines = []
    for name, scene in SCENES.items():
        rig = Rig(scene)
        lines += [f"# {key} = {value}" for key, value in {"scene": name, **DEFAULTS, **scene}.items()]
        lines.append("step,q1,dq1,q2,dq2,held,impacts,sticks,friction,stuck_time")
        for row in ROWS:
            # The plant's steps are doubles, and so is their length.
            rig.advance(row * mpf(scene["step"]))
            held = rig.mode[1] if rig.mode and rig.mode[0] == "held" else 0
            state = [mp.nstr(value, 25) for value in (rig.q1, rig.dq1, rig.q2, rig.dq2)]
            totals = [str(rig.impacts), str(rig.sticks), mp.nstr(rig.friction, 20), mp.nstr(rig.stuck_time, 20)]
            lines.append(",".join([str(row), *state, str(held), *totals]))
        print(name, rig.impacts, "impacts", rig.sticks, "sticks", mp.nstr(rig.stuck_time, 5), "s stuck", flush=True)
    FILE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
