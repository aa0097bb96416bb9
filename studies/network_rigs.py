"""Are the settled points of a rig across the network, which shares no code with vines, on its exact backbone?

python studies/network_rigs.py RIGS SEED SNR    writes validation/network_rigs.csv

Random rigs: f0 2 to 80 Hz, epsilon 0.003 to 0.03, lambda 0.4 to 2.5, r 0.35 to 0.8, b 2 to 20 mm, an ideal cavity. They
are simulated by a fourth-order Runge-Kutta method with impacts located by bisection, and speak the protocol of
tests/fmpy/network_rig.py. Both sensors have noise with a constant floor, SNR in dB below 0.4 b and epsilon b. `vines
backbone` tracks them from rest, with a scene that is wrong by up to 1 % in f0, 30 % in zeta, 10 % in epsilon and b, and
0.15 in r. A point is compared with the exact backbone of the rig (`vines orbit --backbone`) at its response: errors of
frequency and drive over their standard uncertainties u. `failed`: rigs without a result. The worst of each rig is
printed. It needs a release build of `vines`.
"""

import json
import math
import random
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parent.parent
sys.path.append(str(ROOT / "tests/fmpy"))

from network_rig import LockStepServer  # noqa: E402

VINES = ROOT / "target/release/vines"
#: Steps of the method in a sample: 200 in a period leave errors of 1e-8.
STEPS = 2
TABLE = ROOT / "validation/network_rigs.csv"


def drawn(draw: random.Random) -> tuple[dict[str, float], dict[str, float]]:
    """Return the parameters of a rig, and those of its scene."""

    def logarithmic(low: float, high: float) -> float:
        return math.exp(draw.uniform(math.log(low), math.log(high)))

    f0, epsilon, b = logarithmic(2, 80), logarithmic(0.003, 0.03), logarithmic(0.002, 0.02)
    zeta, r = 0.5 * epsilon * draw.uniform(0.4, 2.5), draw.uniform(0.35, 0.8)
    off = [1 + draw.uniform(-most, most) for most in (0.01, 0.3, 0.1, 0.1)]
    wrong = [value * factor for value, factor in zip((f0, zeta, epsilon, b), off, strict=True)]
    return plant(f0, zeta, epsilon, b, r), plant(*wrong, min(max(r + draw.uniform(-0.15, 0.15), 0.2), 0.95))


def plant(f0: float, zeta: float, epsilon: float, b: float, r: float) -> dict[str, float]:
    """Return parameters as a scene has them; the mass is 1 kg."""
    omega = 2 * math.pi * f0
    return {"M": 1.0, "k": omega**2, "c": 2 * zeta * omega, "m": epsilon, "b": b, "r": r}


class Rig:
    """A mass on a moving base with a particle in its cavity, at rest at first. Sensors read the mass and the base."""

    def __init__(self, rig: dict[str, float], snr: float, seed: int) -> None:
        self.stiffness, self.damping = rig["k"] / rig["M"], rig["c"] / rig["M"]
        self.ratio, self.half_width, self.restitution = rig["m"] / rig["M"], rig["b"], rig["r"]
        floor = 10 ** (-snr / 20) / math.sqrt(2)
        self.noise = floor * 0.4 * rig["b"], floor * self.ratio * rig["b"]
        self.random = random.Random(seed)
        self.phase = self.amplitude = 0.0
        # Displacement and velocity of the mass, and of the particle.
        self.state = (0.0, 0.0, 0.0, 0.0)
        self.read()

    def read(self) -> None:
        self.q = self.state[0] + self.random.gauss(0.0, self.noise[0])
        self.base = self.amplitude * math.sin(self.phase) + self.random.gauss(0.0, self.noise[1])

    def after(self, omega: float, h: float) -> tuple[float, float, float, float]:
        """Return the state after a time without impacts."""
        q, v, p, w = self.state
        bases = []
        for part in (0.0, 0.5, 1.0):
            angle = self.phase + omega * h * part
            moved, speed = self.amplitude * math.sin(angle), self.amplitude * omega * math.cos(angle)
            bases.append(self.stiffness * moved + self.damping * speed)
        first, middle, last = bases
        k, c = self.stiffness, self.damping
        a1 = first - k * q - c * v
        v2 = v + 0.5 * h * a1
        a2 = middle - k * (q + 0.5 * h * v) - c * v2
        v3 = v + 0.5 * h * a2
        a3 = middle - k * (q + 0.5 * h * v2) - c * v3
        v4 = v + h * a3
        a4 = last - k * (q + h * v3) - c * v4
        return (
            q + h * (v + 2 * v2 + 2 * v3 + v4) / 6,
            v + h * (a1 + 2 * a2 + 2 * a3 + a4) / 6,
            p + h * w,
            w,
        )

    def advance(self, omega: float, amplitude: float, duration: float) -> None:
        """Move the base as `amplitude sin(phase)` for a sample period, and read the sensors."""
        self.amplitude = amplitude
        step = duration / STEPS
        for _ in range(STEPS):
            left = step
            while left > 0.0:
                left -= self.flight(omega, left)
        self.read()

    def flight(self, omega: float, longest: float) -> float:
        """Advance to the next impact, at most for a time; return the time."""
        time, there = longest, self.after(omega, longest)
        is_impact = abs(there[0] - there[2]) > self.half_width
        if is_impact:
            low = 0.0
            while time - low > 1e-15 * longest:
                half = 0.5 * (low + time)
                at = self.after(omega, half)
                low, time, there = (low, half, at) if abs(at[0] - at[2]) > self.half_width else (half, time, there)
        self.phase = (self.phase + omega * time) % (2 * math.pi)
        q, v, p, w = there
        relative = v - w
        if is_impact:
            jump = (1 + self.restitution) * relative / (1 + self.ratio) if relative * (q - p) > 0 else 0.0
            v, w = v - self.ratio * jump, w + jump
            # Just inside, so that rounding makes no second impact.
            p = q - math.copysign(self.half_width * (1 - 1e-12), q - p)
        self.state = q, v, p, w
        return time


def words(values: dict[str, float]) -> list[str]:
    """Return options that put parameters and sensor into a scene."""
    return [f"--set=plant.{key}={value!r}" for key, value in values.items()] + ["--set=resonance.sensor=q1"]


def run(command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(VINES), *command], capture_output=True, text=True, check=False)


def interpolated(curve: NDArray[np.float64], amplitude: float) -> NDArray[np.float64]:
    """Return frequency and drive at a response, by the cubic through four points of a curve."""
    middle = int(np.searchsorted(curve[:, 0], amplitude))
    near = curve[min(max(middle - 2, 0), len(curve) - 4) :][:4]
    weights = [
        math.prod((amplitude - other) / (own - other) for other in near[:, 0] if other != own) for own in near[:, 0]
    ]
    return np.array(weights) @ near[:, 1:]


def judged(number: int, seed: int, snr: float) -> tuple[str, list[float], list[int]]:
    """Return what a rig has printed if it has no result, errors over u, and the counts of points and settled points."""
    own = 1000 * seed + number
    rig, scene = drawn(random.Random(own))
    with LockStepServer(Rig(rig, snr, own)) as address, tempfile.TemporaryDirectory() as folder:
        done = run(["backbone", "--rig", address, "--out", folder, "--json", *words(scene)])
    if done.returncode:
        return f"rig {number}: {done.stderr[-600:]}", [], [0, 0]
    exact = json.loads(run(["orbit", "--backbone", "--json", *words(rig)]).stdout)[0]["points"]
    omega0, epsilon = math.sqrt(rig["k"] / rig["M"]), rig["m"] / rig["M"]
    curve = np.array(
        [[one["C"] * rig["b"], one["Omega"] * omega0 / math.tau, one["G"] * epsilon * rig["b"]] for one in exact]
    )
    # Down to the fold.
    curve = curve[np.argmin(curve[:, 0]) :: -1]
    points = json.loads(done.stdout)["points"]
    settled = [one for one in points if one["settled"]]
    errors = []
    for point in settled:
        there = interpolated(curve, point["A_m"])
        errors += [
            abs(point[name] - value) / point[f"u_{name}"] for name, value in zip(("f_Hz", "E_m"), there, strict=True)
        ]
    print(f"rig {number}: worst {max(errors, default=math.nan):.1f} u of {len(settled)} settled points", flush=True)
    return "", errors, [len(points), len(settled)]


def main() -> None:
    rigs, seed, snr = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(judged, range(rigs), [seed] * rigs, [snr] * rigs))
    failed = [text for text, *_ in found if text]
    print("\n".join(failed))
    errors = np.array([error for _, one, _ in found for error in one])
    points, settled = np.array([counts for *_, counts in found]).sum(axis=0)
    shares = f"{np.mean(errors <= 1.96):.3f},{np.mean(errors <= 3):.4f},{max(errors, default=math.nan):.1f}"
    row = f"{rigs},{seed},{snr:g},{len(failed)},{points},{settled},{shares}"
    header = "rigs,seed,snr_dB,failed,points,settled,within_1.96u,within_3u,worst_u"
    rows = TABLE.read_text().splitlines()[1:] if TABLE.exists() else []
    kept = [one for one in rows if one.split(",")[:3] != row.split(",")[:3]]
    TABLE.write_text("\n".join([header, *kept, row]) + "\n")
    print(header, row, sep="\n")


if __name__ == "__main__":
    main()
