"""The rig in many-digit arithmetic, from impact to impact: truth.py says how a contact is found."""

from math import inf

from motion import Motion, Oscillator, bisected, newton
from mpmath import mp, mpf

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
