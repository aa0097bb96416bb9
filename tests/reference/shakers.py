"""Reference trajectories of structures with an electrodynamic shaker, in 40-digit arithmetic.

python tests/reference/shakers.py [scene ...] writes scenes of tests/reference/shakers.json. Nothing is shared with the
plant: displacements of structure and armature, the matrices of the whole first-order system with its eigenvectors, the
instants at which the command is clipped by the arc sine, events as in cavity.py.
"""

import json
import sys
from pathlib import Path

from cavity import DEFAULTS, LOCK
from mpmath import asin, ceil, eig, exp, eye, im, inverse, lu_solve, matrix, mp, mpc, mpf, nstr, pi, re, zeros
from structures import BEAM, FRAME, ROWS, StructureRig

FILE = Path(__file__).with_suffix(".json")
SHAKER = {
    "mass": 0.057, "suspension": [9932.0, 21.5], "stinger": [80000.0, 0.4], "end_mass": 0.01, "resistance": 2.0,
    "inductance": 0.0, "force_factor": 6.78, "amplifier": "voltage", "gain": 3.0,
}  # fmt: skip
START = {"q2": -0.009, "dq2": -0.5, "step": 0.0004}
TABLE = {"mass": 12.0, "suspension": [90000.0, 300.0], "stinger": [3e7, 900.0], "end_mass": 40.0, "force_factor": 120.0}
BASE = {**BEAM, "base": True}
SCENES = {
    "voltage": {**BEAM, **START, "E": 1.1, "omega": 51.0, "shaker": SHAKER},
    "inductance": {**BEAM, **START, "E": 1.1, "omega": 51.0, "shaker": {**SHAKER, "inductance": 0.004}},
    "filtered": {
        **FRAME, **START, "E": 4.1, "omega": 53.0,
        "shaker": {**SHAKER, "stinger": [3e6, 4.0], "inductance": 0.001, "cut_off": 900.0},
    },
    "current": {**FRAME, **START, "E": 1.7, "omega": 57.0, "shaker": {**SHAKER, "amplifier": "current", "gain": 2.0}},
    "current-filtered": {
        **BEAM, **START, "E": 0.6, "omega": 57.0, "shaker": {**SHAKER, "amplifier": "current", "cut_off": 300.0},
    },
    "clipped": {**BEAM, **START, "E": 2.1, "omega": 51.0, "shaker": {**SHAKER, "inductance": 0.004}, "limit": 1.3},
    "clipped-contact": {
        **BEAM, "theta": 0.5, "E": 4.0, "omega": 50.0, "q2": 0.01, "step": 0.0004, "limit": 2.5,
        "shaker": {**SHAKER, "inductance": 0.004},
    },
    "chatter": {
        **BEAM, "theta": 1.2, "r_plus": 0.5, "r_minus": 0.5, "E": 2.0, "omega": 49.0, "step": 0.0004,
        "shaker": {**SHAKER, "inductance": 0.004, "cut_off": 500.0},
    },
    "table": {**BASE, **LOCK, "q1": 0.0, "q2": -0.009, "E": 0.05, "step": 0.0004, "shaker": {**SHAKER, **TABLE}},
}  # fmt: skip


class Motion:
    """The motion with a further mass at the cavity, under the command and a constant force there."""

    def __init__(self, rig, system, force):
        self.rig, self.system, self.t = rig, system, rig.t
        self.rest = system["at rest"] * force
        self.steady = system["steady"]
        if rig.level is not None:
            self.rest = self.rest + system["held"] * rig.level
            self.steady = self.steady * 0
        turned = self.steady * exp(mpc(0, rig.p["omega"] * rig.t))
        self.weights = system["inverse"] * (rig.x - self.rest - turned.apply(im))

    def state(self, t):
        turned = self.steady * exp(mpc(0, self.rig.p["omega"] * t))
        grown = [w * exp(r * (t - self.t)) for w, r in zip(self.weights, self.system["rates"], strict=True)]
        return (self.system["vectors"] * matrix(grown)).apply(re) + self.rest + turned.apply(im), grown, turned

    def at(self, t):
        """Displacement, velocity and acceleration at the cavity."""
        state, grown, turned = self.state(t)
        n, w = self.rig.n, self.rig.p["omega"]
        slope = self.system["vectors"] * matrix([g * r for g, r in zip(grown, self.system["rates"], strict=True)])
        rows = [[values[k + i] for i in range(n)] for values, k in ((state, 0), (state, n))]
        rows.append([re(slope[n + i]) + w * re(turned[n + i]) for i in range(n)])
        return tuple(sum(a * b for a, b in zip(self.rig.row, values, strict=True)) for values in rows)


class ShakerRig(StructureRig):
    def __init__(self, scene):
        super().__init__(scene)
        given = scene["shaker"]
        s = {k: mpf(v) if isinstance(v, float) else v for k, v in given.items()}
        (k_a, c_a), (k_s, c_s) = ([mpf(x) for x in s[key]] for key in ("suspension", "stinger"))
        _, damping, stiffness = self.matrices
        modes, has_base = self.n, scene.get("base", False)
        n = self.n = modes + has_base + 1
        armature = n - 1
        drive = matrix([mpf(x) for x in scene["drive"]])

        def whole(part):
            """A matrix of the structure, which a base may move by its springs and dampers, beside the armature."""
            way = eye(modes)
            if has_base:
                way = zeros(modes, modes + 1)
                way[:, :modes], way[:, modes] = eye(modes), -drive
            part = way.T * part * way
            result = zeros(n, n)
            result[: part.rows, : part.cols] = part
            return result

        end = zeros(n, 1)
        for i in range(modes):
            end[i] = mpf(0) if has_base else drive[i]
        if has_base:
            end[modes] = mpf(1)
        tip = zeros(n, 1)
        tip[armature] = mpf(1)
        stretch = tip - end
        mass = zeros(n, n)
        mass[:modes, :modes] = eye(modes)
        mass = mass + s["mass"] * tip * tip.T + s["end_mass"] * end * end.T
        damping = whole(damping) + c_a * tip * tip.T + c_s * stretch * stretch.T
        stiffness = whole(stiffness) + k_a * tip * tip.T + k_s * stretch * stretch.T
        self.row = self.row + [mpf(0)] * (n - modes)
        cavity = matrix(self.row)
        # The electric states: current of the coil and output of the amplifier, where they are states.
        factor, gain, resistance, inductance = s["force_factor"], s["gain"], s["resistance"], s["inductance"]
        is_voltage = s["amplifier"] == "voltage"
        has_coil, has_filter = is_voltage and inductance > 0, "cut_off" in s
        size = 2 * n + has_coil + has_filter
        by_command = zeros(size, 1)
        back = inverse(mass)
        self.systems, self.size = [], size
        for particle in (mpf(0), self.p["m"]):
            total = mass + particle * cavity * cavity.T
            back = inverse(total)
            state = zeros(size, size)
            damped = damping.copy()
            if is_voltage and not has_coil:
                damped = damped + factor**2 / resistance * tip * tip.T
            state[:n, n : 2 * n], state[n : 2 * n, :n], state[n : 2 * n, n : 2 * n] = (
                eye(n),
                -back * stiffness,
                -back * damped,
            )
            force_per_output = factor / resistance if is_voltage else factor
            by_command = zeros(size, 1)
            if has_coil:
                coil = 2 * n
                state[n : 2 * n, coil] = back * tip * factor
                state[coil, coil] = -resistance / inductance
                state[coil, n + armature] = -factor / inductance
            if has_filter:
                last = size - 1
                state[last, last] = -s["cut_off"]
                by_command[last] = s["cut_off"] * gain
                if has_coil:
                    state[coil, last] = 1 / inductance
                else:
                    state[n : 2 * n, last] = back * tip * force_per_output
            elif has_coil:
                by_command[coil] = gain / inductance
            else:
                by_command[n : 2 * n, 0] = back * tip * force_per_output * gain
            rates, vectors = eig(state)
            by_force = zeros(size, 1)
            by_force[n : 2 * n, 0] = back * cavity
            self.systems.append({
                "rates": rates, "vectors": vectors, "inverse": inverse(vectors),
                "steady": lu_solve(mpc(0, self.p["omega"]) * eye(size) - state, by_command) * self.p["E"],
                "held": lu_solve(-state, by_command), "at rest": lu_solve(-state, by_force),
            })  # fmt: skip
        self.kicks = inverse(mass) * cavity
        self.mobility = (cavity.T * self.kicks)[0]
        self.p["M"] = 1 / self.mobility
        self.scan = 1 / max(abs(rate) for rate in self.systems[0]["rates"] if im(rate) != 0) / 10
        self.x, self.level = zeros(size, 1), None
        self.coil = (is_voltage, has_coil, has_filter, factor, gain, resistance)

    def both(self, dq1=None):
        kept = self.x
        if dq1 is not None:
            self.x = kept.copy()
            self.add(self.x, dq1 - self.dq1)
        motion = Motion(self, self.systems[1], self.p["m"] * self.a_g)
        self.x = kept
        return motion

    def alone(self, force):
        return Motion(self, self.systems[0], force)

    def add(self, state, velocity):
        for i, kick in enumerate(self.kicks):
            state[self.n + i] += kick * velocity / self.mobility

    def advance(self, limit):
        """Between the instants at which the command is clipped or released."""
        highest, amplitude, w = self.p.get("limit"), self.p["E"], self.p["omega"]
        if highest is None:
            return super().advance(limit)
        first, last = asin(highest / amplitude), w * limit / pi
        crossings = [(k * pi + side) / w for k in range(int(ceil(last)) + 1) for side in (first, pi - first)]
        begin = self.t
        for end in [*(t for t in crossings if begin < t < limit), limit]:
            middle = amplitude * mp.sin(w * (begin + end) / 2)
            self.level = None if abs(middle) <= highest else highest * mp.sign(middle)
            super().advance(end)
            begin = end
        return None

    def current(self):
        is_voltage, has_coil, has_filter, factor, gain, resistance = self.coil
        command = self.level if self.level is not None else self.p["E"] * mp.sin(self.p["omega"] * self.t)
        output = self.x[self.size - 1] if has_filter else gain * command
        if has_coil:
            return self.x[2 * self.n]
        return (output - factor * self.x[2 * self.n - 1]) / resistance if is_voltage else output


def main():
    mp.dps = 40
    found = json.loads(FILE.read_text())
    for name in sys.argv[1:] or SCENES:
        scene = {**DEFAULTS, **SCENES[name]}
        rig = ShakerRig(scene)
        _, damping, stiffness = ([[float(x) for x in row] for row in values.tolist()] for values in rig.matrices)
        keys = ("cavity", "drive", "m", "E", "omega", "q2", "dq2", "mu_k", "shaker")
        written = {
            **{key: scene[key] for key in keys}, "C": damping, "K": stiffness, "b": scene["b_plus"],
            "r": scene["r_plus"], "tilt": scene["theta"], "base": scene.get("base", False),
            **({"limit": scene["limit"]} if "limit" in scene else {}),
            **({"chatter": True} if scene["theta"] else {}),
        }  # fmt: skip
        rows = []
        for step in ROWS:
            rig.advance(step * mpf(scene["step"]))
            held = rig.mode[1] if rig.mode and rig.mode[0] == "held" else 0
            values = [*rig.x[: 2 * rig.n], rig.q2, rig.dq2, rig.current()]
            rows.append([nstr(rig.t, 20), *(nstr(value, 22) for value in values), rig.impacts, held])
        columns = "t, q..., base if any, x, and their velocities, q2, q2', current, impacts so far, wall stuck to"
        found[name] = {"scene": written, "columns": columns, "step": scene["step"], "steps": ROWS, "rows": rows}
        lines = (f"{json.dumps(one)}: {json.dumps(found[one])}" for one in sorted(found))
        FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n")
        print(name, rig.impacts, "impacts", rig.sticks, "sticks", nstr(rig.stuck_time, 5), "s stuck", flush=True)


if __name__ == "__main__":
    main()
