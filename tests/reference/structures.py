"""Reference trajectories of structures in a real cavity, in 40-digit arithmetic.

python tests/reference/structures.py [scene ...] writes scenes of tests/reference/structures.json: persistent contact,
chatter and friction with two or three modes. Nothing is shared with the plant: eigenvectors of the whole first-order
system, events as in cavity.py.
"""

import json
import sys
from pathlib import Path

from cavity import DEFAULTS, LOCK, Rig
from mpmath import diag, eig, exp, eye, im, inverse, lu_solve, matrix, mp, mpc, mpf, nstr, re, zeros

FILE = Path(__file__).with_suffix(".json")
STEPS = 1000
ROWS = [1, 2, 5, 10, 20, 50, 100, 200, 400, 600, 800, 1000]

BEAM = {
    "omegas": [55.0, 345.0], "zetas": [0.006, 0.006], "cavity": [0.5125, -0.5125], "drive": [1.9, 0.6],
    "coupling": 0.0,
}  # fmt: skip
FRAME = {
    "omegas": [55.0, 61.0, 170.0], "zetas": [0.006, 0.01, 0.02], "cavity": [0.45, 0.25, -0.3],
    "drive": [0.5, -0.2, 0.3], "coupling": 3.0, "force": True,
}  # fmt: skip
SCENES = {
    "contact": {**BEAM, "theta": 0.5, "E": 0.0003, "omega": 50.0, "q2": 0.01, "step": 0.0004},
    "contact-force": {**FRAME, "theta": 0.5, "E": 12.0, "omega": 50.0, "q2": 0.01, "step": 0.0004},
    "chatter": {**BEAM, "theta": 1.2, "r_plus": 0.5, "r_minus": 0.5, "E": 0.0005, "omega": 49.0, "step": 0.0004},
    "chatter-force": {**FRAME, "theta": 1.2, "r_plus": 0.5, "r_minus": 0.5, "E": 5.0, "omega": 49.0, "step": 0.0004},
    "friction": {**BEAM, **LOCK, "q1": 0.0, "q2": -0.009, "mu_k": 0.05, "step": 0.001},
    "stick-slip": {
        **FRAME, "b_plus": 0.05, "b_minus": 0.05, "mu_k": 0.5, "mu_s": 0.8, "E": 6.0, "omega": 50.0, "step": 0.0005,
    },
}  # fmt: skip


class Motion:
    """The motion of the structure, with a further mass at the cavity, under its drive and a constant force there."""

    def __init__(self, rig, system, force, state):
        self.rig, self.system, self.t = rig, system, rig.t
        self.rest = system["at rest"] * force
        self.steady = system["steady"]
        turned = self.steady * exp(mpc(0, rig.p["omega"] * rig.t))
        free = state - self.rest - turned.apply(im)
        self.weights = system["inverse"] * free

    def state(self, t):
        turned = self.steady * exp(mpc(0, self.rig.p["omega"] * t))
        rates = self.system["rates"]
        grown = matrix([w * exp(rate * (t - self.t)) for w, rate in zip(self.weights, rates, strict=True)])
        return (self.system["vectors"] * grown).apply(re) + self.rest + turned.apply(im), grown, turned

    def at(self, t):
        """Displacement, velocity and acceleration at the cavity."""
        state, grown, turned = self.state(t)
        n, row = self.rig.n, self.rig.row
        rates, vectors, w = self.system["rates"], self.system["vectors"], self.rig.p["omega"]
        free = vectors * matrix([g * rate for g, rate in zip(grown, rates, strict=True)])
        acceleration = [re(free[n + i]) + w * re(turned[n + i]) for i in range(n)]
        return tuple(
            sum(a * b for a, b in zip(row, values, strict=True)) for values in (state[:n], state[n:], acceleration)
        )


class StructureRig(Rig):
    def __init__(self, scene):
        omegas, zetas = ([mpf(x) for x in scene[key]] for key in ("omegas", "zetas"))
        n = self.n = len(omegas)
        self.row = [mpf(x) for x in scene["cavity"]]
        drive = matrix([mpf(x) for x in scene["drive"]])
        # All entries are doubles, as the plant reads them.
        stiffness = diag([mpf(float(x * x)) for x in omegas])
        damping = diag([mpf(float(2 * z * x)) for x, z in zip(omegas, zetas, strict=True)])
        for i in range(2):
            for j in range(2):
                damping[i, j] = mpf(float(damping[i, j] + scene["coupling"] * (1 if i == j else 0.5)))
        self.matrices = eye(n), damping, stiffness
        mobility = sum(x * x for x in self.row)
        super().__init__({**{k: v for k, v in scene.items() if k not in ("cavity", "drive")}, "M": 1.0, "k": 1.0})
        self.p["M"] = 1 / mobility
        self.scan = 1 / omegas[-1] / 20
        self.x = zeros(2 * n, 1)
        w, amplitude = self.p["omega"], self.p["E"]
        force = amplitude * (drive if scene.get("force") else stiffness * drive + mpc(0, w) * damping * drive)
        cavity = matrix(self.row)
        self.systems = []
        for mass in (mpf(0), self.p["m"]):
            whole = eye(n) + mass * cavity * cavity.T
            back = inverse(whole)
            state = zeros(2 * n, 2 * n)
            state[:n, n:], state[n:, :n], state[n:, n:] = eye(n), -back * stiffness, -back * damping
            rates, vectors = eig(state)
            position = lu_solve(stiffness - w**2 * whole + mpc(0, w) * damping, force)
            steady = matrix([*position, *(mpc(0, w) * position)])
            rest = matrix([*lu_solve(stiffness, cavity), *([0] * n)])
            system = {
                "rates": rates,
                "vectors": vectors,
                "inverse": inverse(vectors),
                "steady": steady,
                "at rest": rest,
            }
            self.systems.append(system)

    def both(self, dq1=None):
        state = self.x.copy()
        if dq1 is not None:
            self.add(state, dq1 - self.dq1)
        return Motion(self, self.systems[1], self.p["m"] * self.a_g, state)

    def alone(self, force):
        return Motion(self, self.systems[0], force, self.x)

    def add(self, state, velocity):
        for i, shape in enumerate(self.row):
            state[self.n + i] += shape * velocity * self.p["M"]

    def kick(self, velocity):
        self.add(self.x, velocity)
        self.dq1 += velocity

    def follow(self, motion):
        self.x = motion.state(self.t)[0]
        self.q1, self.dq1, _ = motion.at(self.t)


def main():
    mp.dps = 40
    found = json.loads(FILE.read_text())
    for name in sys.argv[1:] or SCENES:
        scene = {**DEFAULTS, **SCENES[name]}
        rig = StructureRig(scene)
        mass, damping, stiffness = ([[float(x) for x in row] for row in values.tolist()] for values in rig.matrices)
        written = {
            "M": mass, "C": damping, "K": stiffness, "cavity": scene["cavity"], "m": scene["m"], "b": scene["b_plus"],
            "r": scene["r_plus"], "q0": [0.0] * rig.n, "dq0": [0.0] * rig.n, "q2": scene["q2"], "dq2": scene["dq2"],
            "omega": scene["omega"], "mu_k": scene["mu_k"], "tilt": scene["theta"],
            "F" if scene.get("force") else "E": scene["E"], "drive" if scene.get("force") else "base": scene["drive"],
            **({"mu_s": scene["mu_s"]} if "mu_s" in scene else {}),
            **({"chatter": True} if name.startswith(("chatter", "contact")) else {}),
        }  # fmt: skip
        rows, counts = [], []
        for step in ROWS:
            rig.advance(step * mpf(scene["step"]))
            held = rig.mode[1] if rig.mode and rig.mode[0] == "held" else 0
            values = [*rig.x, rig.q2, rig.dq2]
            rows.append([nstr(rig.t, 20), *(nstr(value, 22) for value in values), rig.impacts, held])
            counts.append(step)
        columns = "t, q..., q'..., q2, q2', impacts so far, wall stuck to"
        found[name] = {"scene": written, "columns": columns, "step": scene["step"], "steps": counts, "rows": rows}
        lines = (f"{json.dumps(one)}: {json.dumps(found[one])}" for one in sorted(found))
        FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n")
        print(name, rig.impacts, "impacts", rig.sticks, "sticks", nstr(rig.stuck_time, 5), "s stuck", flush=True)


if __name__ == "__main__":
    main()
