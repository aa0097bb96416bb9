"""The Python peers: each is made for a scene and a setting (a tolerance), and then steps.

    python peers.py NAME SCENES.json [FMU]     answers requests on standard input, a line each, as the Rust side does

A peer that meets a wall gets the impact law and goes on. None of them knows about sticking: whether it survives a
chatter is part of what is measured.
"""

import json
import sys
import time
from importlib.metadata import PackageNotFoundError, version
from math import cos, pi, sin
from pathlib import Path

from scenes import load

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


class FmpyPlant(Peer):
    """This plant as an FMU, stepped by FMPy: two inputs set, one step, four outputs read."""

    package = "FMPy"
    fmu = None
    state = (9, 10, 11, 12)

    def __init__(self, scene, setting):
        from fmpy import extract, read_model_description
        from fmpy.fmi2 import FMU2Slave

        super().__init__(scene, setting)
        cls = type(self)
        if cls.fmu is None:
            folder = extract(sys.argv[3])
            cls.fmu = folder, read_model_description(folder)
        folder, description = cls.fmu
        self.slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="rig",
        )
        self.slave.instantiate()
        first = scene["drives"][0]
        self.slave.setupExperiment(startTime=0.0)
        self.slave.setReal(range(6), [self.M, self.k, self.c, self.m, self.b, self.r])
        self.slave.setReal(self.state, self.y)
        self.slave.setReal((8, 7), (first[1], first[0]))
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def step(self, amplitude, omega, duration):
        slave = self.slave
        slave.setReal((8, 7), (omega, amplitude))
        slave.doStep(currentCommunicationPoint=self.time, communicationStepSize=duration)
        self.time += duration
        self.y = slave.getReal(self.state)
        if time.perf_counter() > DEADLINE[0]:
            raise Failed("time limit")

    @property
    def impacts(self):
        return self.slave.getInteger([18])[0]

    @impacts.setter
    def impacts(self, count):
        pass


class Heyoka(Peer):
    """Taylor series of adaptive order; terminal events whose callback is the impact. Compiled before it is timed."""

    package = "heyoka"
    in_step = 0

    def __deepcopy__(self, _memo):
        """The integrator copies its callbacks deeply; this one is to count here."""
        return self

    def __init__(self, scene, setting):
        import heyoka as hy

        super().__init__(scene, setting)
        self.reached = hy.taylor_outcome.time_limit
        q1, v1, q2, v2 = hy.make_vars("q1", "v1", "q2", "v2")
        amplitude, omega, angle = hy.par[0], hy.par[1], hy.par[2]
        turn = omega * hy.time + angle
        pull = self.k * amplitude * hy.sin(turn) + self.c * amplitude * omega * hy.cos(turn)
        equations = [(q1, v1), (v1, (pull - self.c * v1 - self.k * q1) / self.M), (q2, v2), (v2, 0.0 * q2)]
        closing = hy.event_direction.negative
        walls = [hy.t_event(self.b - s * (q1 - q2), callback=self.met, direction=closing) for s in (1.0, -1.0)]
        self.integrator = hy.taylor_adaptive(
            equations, self.y, pars=[0.0, 1.0, 0.0], tol=self.tolerance, t_events=walls, compact_mode=False
        )
        # Views into the integrator.
        self.y, self.pars = self.integrator.state, self.integrator.pars

    def again(self):
        """Back to the start: what is compiled stays."""
        self.y[:] = self.scene["start"]
        self.integrator.reset_cooldowns()
        self.angle, self.impacts, self.time = 0.0, 0, 0.0

    def met(self, _integrator, _sign):
        self.rebound()
        self.in_step += 1
        return self.in_step < MOST_IMPACTS_PER_STEP and time.perf_counter() < DEADLINE[0]

    def step(self, amplitude, omega, duration):
        integrator = self.integrator
        self.in_step = 0
        self.pars[:] = amplitude, omega, self.angle
        integrator.time = 0.0
        outcome = integrator.propagate_until(duration)[0]
        if outcome != self.reached:
            if self.in_step >= MOST_IMPACTS_PER_STEP:
                raise Failed(f"stalled at t = {self.time + integrator.time:.3f} after {self.impacts} impacts")
            late = time.perf_counter() > DEADLINE[0]
            raise Failed("time limit" if late else f"{outcome} at t = {self.time + integrator.time:.3f}")
        self.angle = (self.angle + omega * duration) % (2 * pi)
        self.time += duration


class Scipy(Peer):
    """solve_ivp with terminal events, restarted after every impact."""

    package = "scipy"
    method = "DOP853"

    def __init__(self, scene, setting):
        from scipy.integrate import solve_ivp

        super().__init__(scene, setting)
        self.solve = solve_ivp
        self.walls = [self.wall(1.0), self.wall(-1.0)]
        self.checked = 0

    def wall(self, s):
        def gap(_t, y):
            return self.b - s * (y[0] - y[2])

        gap.terminal, gap.direction = True, -1
        return gap

    def right(self, t, y):
        self.checked += 1
        if not self.checked % 4096 and time.perf_counter() > DEADLINE[0]:
            raise Failed("time limit")
        return y[1], self.acceleration(t, y[0], y[1]), y[3], 0.0

    def fly(self, left):
        options = {"rtol": max(self.tolerance, 2.3e-14), "atol": self.tolerance}
        found = self.solve(self.right, (0.0, left), self.y, self.method, events=self.walls, **options)
        if found.status < 0:
            raise Failed(f"{found.message} at t = {self.time:.3f}")
        self.y = found.y[:, -1].tolist()
        return float(found.t[-1]), found.status == 1


class ScipyLsoda(Scipy):
    method = "LSODA"


class ScipyRadau(Scipy):
    method = "Radau"


class Cvode(Peer):
    """CVODE (Adams; the problem is not stiff) through scikit-sundae, stopped by its root functions."""

    package = "scikit-sundae"

    def __init__(self, scene, setting):
        import numpy as np
        from sksundae.cvode import CVODE

        super().__init__(scene, setting)

        def right(t, y, yp):
            q1, v1, _, v2 = y.tolist()
            yp[:] = v1, self.acceleration(t, q1, v1), v2, 0.0

        def gaps(_t, y, g):
            w = y[0] - y[2]
            g[:] = self.b - w, self.b + w

        gaps.terminal, gaps.direction = [True, True], [-1, -1]
        options = {"rtol": self.tolerance, "atol": self.tolerance, "max_num_steps": 100_000}
        self.solver = CVODE(right, method="Adams", eventsfn=gaps, num_events=2, **options)
        self.array = np.array

    def fly(self, left):
        found = self.solver.solve(self.array([0.0, left]), self.array(self.y))
        if not found.success:
            raise Failed(f"{found.message} at t = {self.time:.3f}")
        self.y = found.y[-1].tolist()
        end = float(found.t[-1])
        return end, end < left


PEERS = {
    "heyoka": Heyoka,
    "scipy-dop853": Scipy,
    "scipy-lsoda": ScipyLsoda,
    "scipy-radau": ScipyRadau,
    "cvode": Cvode,
    "fmpy": FmpyPlant,
}


KEPT = {}


def made(peer, scene, setting):
    """The method at the start of the scene; one that compiles is kept, and set back."""
    if not hasattr(peer, "again"):
        return peer(scene, setting)
    key = scene["title"], setting
    if key in KEPT:
        KEPT[key].again()
    else:
        KEPT[key] = peer(scene, setting)
    return KEPT[key]


def run(peer, scene, setting, checks, limit):
    """Time in ns, states after the steps named in `checks`, impacts."""
    method = made(peer, scene, setting)
    states, wanted = [], set(checks)
    began = time.perf_counter_ns()
    DEADLINE[0] = time.perf_counter() + limit
    for n, (amplitude, omega, duration) in enumerate(scene["drives"], 1):
        try:
            method.step(amplitude, omega, duration)
        except Failed as failure:
            done = 100 * (n - 1) / len(scene["drives"])
            how = f"time limit: {done:.2f} % done after {limit:g} s" if "time limit" in str(failure) else str(failure)
            raise Failed(how) from None
        if n in wanted:
            states.append([float(x) for x in method.y])
    return time.perf_counter_ns() - began, states, method.impacts


def answer(peer, scenes, request):
    scene = scenes[request["scene"]]
    reply = {"ns": [], "states": [], "impacts": 0, "failure": None}
    began = time.perf_counter()
    while not reply["ns"] or time.perf_counter() - began < request["budget"]:
        try:
            ns, reply["states"], reply["impacts"] = run(
                peer, scene, request["setting"], request["checks"], request["limit"]
            )
            reply["ns"].append(ns)
        except Failed as failure:
            reply["failure"] = str(failure)
            break
        except Exception as error:  # a peer's own way of failing
            reply["failure"] = f"{type(error).__name__}: {error}"
            break
    return reply


def main():
    peer = PEERS[sys.argv[1]]
    scenes = load(Path(sys.argv[2]))
    try:
        found = version(peer.package)
    except PackageNotFoundError:
        sys.exit(f"the package {peer.package} is not installed")
    print(json.dumps({"version": f"{peer.package} {found}"}), flush=True)
    for line in sys.stdin:
        print(json.dumps(answer(peer, scenes, json.loads(line))), flush=True)


if __name__ == "__main__":
    main()
