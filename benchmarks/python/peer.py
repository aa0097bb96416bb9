"""What all Python peers share: the rig, its impact law, and the march from flight to flight."""

import time
from math import cos, pi, sin

MOST_IMPACTS_PER_STEP = 5000
DEADLINE = [0.0]


class Failed(Exception):
    """How a method failed."""


class Peer:
    """The rig as an initial value problem, for methods that stop at events."""

    def __init__(self, scene, setting):
        self.scene, self.tolerance = scene, setting
        self.M, self.k, self.c, self.m, self.b, self.r = (scene[key] for key in "Mkcmbr")
        self.y = list(scene["start"])
        self.amplitude, self.omega, self.angle = 0.0, 1.0, 0.0
        self.impacts, self.time = 0, 0.0

    def rebound(self):
        v1, v2 = float(self.y[1]), float(self.y[3])
        momentum, apart = self.M * v1 + self.m * v2, self.r * (v1 - v2)
        v1 = (momentum - self.m * apart) / (self.M + self.m)
        self.y[1], self.y[3] = v1, v1 + apart
        self.impacts += 1

    def acceleration(self, t, q1, v1):
        angle = self.angle + self.omega * t
        pull = self.k * self.amplitude * sin(angle) + self.c * self.amplitude * self.omega * cos(angle)
        return (pull - self.c * v1 - self.k * q1) / self.M

    def step(self, amplitude, omega, duration):
        """From flight to flight; `fly` sets the state and says when the flight ended, and whether at a wall."""
        self.amplitude, self.omega = amplitude, omega
        left, impacts = duration, 0
        while left > 0:
            flown, wall = self.fly(left)
            left -= flown
            self.angle = (self.angle + omega * flown) % (2 * pi)
            if wall:
                self.rebound()
                impacts += 1
                if impacts > MOST_IMPACTS_PER_STEP:
                    raise Failed(f"stalled at t = {self.time + duration - left:.3f} after {self.impacts} impacts")
            if time.perf_counter() > DEADLINE[0]:
                raise Failed("time limit")
        self.time += duration

    def fly(self, left):
        raise NotImplementedError
