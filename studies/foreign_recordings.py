"""How well does `vines fit` find the parameters of a rig that another simulator has recorded, through other sensors?

python studies/foreign_recordings.py [SEEDS]    writes validation/foreign_recordings.csv

The simulator is a fourth-order Runge-Kutta method with impacts located by bisection. Nothing of it is shared with the
plant of vines. The rig is that of the tutorial "From a recording to a scene". Its base goes through levels of drive
and frequency near phase resonance. Both channels pass an anti-alias filter (Butterworth, fourth order, 300 Hz); an
impact excites the filter of an accelerometer as an impulse. Noise is 50 dB below each channel. Rows: what the channels
measure, what is wrong with them, and the seed of the noise. Columns: seconds of 1:1 motion, hypotheses that are
possible, p of the best one, and of the ideal cavity the errors of the parameters over their standard uncertainties u,
and these over the value. It needs a release build of `vines`.
"""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parent.parent
VINES = ROOT / "target/release/vines"
HIDDEN = {"M": 3.807, "k": 11.68e3, "c": 2.9, "m": 0.035, "b": 0.0095, "r": 0.57}
PARAMETERS = ("f0", "zeta", "r", "b", "epsilon")
RATE = 1000.0
GRAVITY = 9.80665
CUT_OFF = 2 * np.pi * 300.0
# Sections of the filter: 2 zeta of each.
SECTIONS = (0.765367, 1.847759)


@dataclass(frozen=True)
class Chain:
    """The measured quantities (0 displacement, 1 velocity, 2 acceleration), and what is wrong with both channels."""

    response: int = 2
    base: int = 2
    snr: float | None = 50.0
    bits: int | None = None
    hum: float = 0.0
    offset: float = 0.0
    drift: float = 0.0
    late: int = 0
    is_stated: bool = False


def levels(count: int) -> list[tuple[float, float]]:
    """Return amplitudes of the base (m) and frequencies (rad/s) near phase resonance of q1, by falling drive."""
    omega0, epsilon = np.sqrt(HIDDEN["k"] / HIDDEN["M"]), HIDDEN["m"] / HIDDEN["M"]
    found = []
    for g in np.linspace(1.75, 1.0, count):
        settings = [f"--set=plant.{key}={value}" for key, value in HIDDEN.items()]
        command = [str(VINES), "orbit", *settings, "--set=resonance.sensor='q1'", f"--set=excitation.G={g}", "--json"]
        orbits = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
        found += [(g * HIDDEN["b"] * epsilon, omega0 * one["Omega"]) for one in orbits if one["stable"]][:1]
    return found


def simulate(schedule: list[tuple[float, float]], hold: int, chain: Chain) -> tuple[NDArray[np.float64], ...]:
    """Return response and base in SI units behind their filters, `RATE` samples a second, `hold` periods a level."""
    # Two steps of the method from sample to sample.
    rate = 2 * RATE
    stiffness, damping = HIDDEN["k"] / HIDDEN["M"], HIDDEN["c"] / HIDDEN["M"]
    ratio, gap, restitution = HIDDEN["m"] / HIDDEN["M"], HIDDEN["b"], HIDDEN["r"]
    step = 1.0 / rate
    # Knots of amplitude and frequency, and the phase as the integral of the frequency.
    knots, amplitude, omega = [0.0], [schedule[0][0]], [schedule[0][1]]
    for n, (e, w) in enumerate(schedule):
        if n:
            knots.append(knots[-1] + 20 * 2 * np.pi / w)
            amplitude.append(e)
            omega.append(w)
        knots.append(knots[-1] + hold * 2 * np.pi / w)
        amplitude.append(e)
        omega.append(w)
    fine = np.arange(int(knots[-1] * rate) * 2 + 3) * 0.5 * step
    envelope, frequency = np.interp(fine, knots, amplitude), np.interp(fine, knots, omega)
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (frequency[1:] + frequency[:-1]) * 0.5 * step)])
    growth = np.gradient(envelope, 0.5 * step)
    bend = np.gradient(frequency, 0.5 * step)
    sine, cosine = np.sin(phase), np.cos(phase)
    motion = envelope * sine
    speed = growth * sine + envelope * frequency * cosine
    acceleration = 2 * growth * frequency * cosine + envelope * (bend * cosine - frequency**2 * sine)
    base = (motion, speed, acceleration)

    def forces(n, share):
        """Quantities of the base at half step n plus a share of a step."""
        place = n + 2.0 * share
        low = int(place)
        part = place - low
        return [one[low] + part * (one[low + 1] - one[low]) for one in base]

    def rates(state, n, share):
        q1, v1, _, v2, *filters = state
        e, de, dde = forces(n, share)
        a1 = stiffness * (e - q1) + damping * (de - v1)
        derivative = [v1, a1, v2, 0.0]
        for signal, of in (((q1, v1, a1)[chain.response], 0), ((e, de, dde)[chain.base], 4)):
            for section, width in enumerate(SECTIONS):
                y, dy = filters[of + 2 * section], filters[of + 2 * section + 1]
                derivative += [dy, CUT_OFF**2 * (signal - y) - width * CUT_OFF * dy]
                signal = y
        return np.array(derivative)

    def advanced(state, n, begin, end):
        h = (end - begin) * step
        middle = 0.5 * (begin + end)
        k1 = rates(state, n, begin)
        k2 = rates(state + 0.5 * h * k1, n, middle)
        k3 = rates(state + 0.5 * h * k2, n, middle)
        k4 = rates(state + h * k3, n, end)
        return state + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4)

    state = np.zeros(12)
    state[3] = 0.9 * gap * np.sqrt(stiffness)
    count = int(knots[-1] * rate)
    read = np.empty((2, count))
    for sample in range(count):
        read[:, sample] = state[6], state[10]
        n, begin = 2 * sample, 0.0
        while begin < 1.0:
            after = advanced(state, n, begin, 1.0)
            if abs(after[0] - after[2]) <= gap:
                state, begin = after, 1.0
                continue
            low, high = begin, 1.0
            for _ in range(50):
                half = 0.5 * (low + high)
                there = advanced(state, n, begin, half)
                low, high = (half, high) if abs(there[0] - there[2]) <= gap else (low, half)
            state = advanced(state, n, begin, low)
            relative = state[1] - state[3]
            jump = -(1 + restitution) * relative / (1 + ratio)
            state[1] += ratio * jump
            state[3] -= jump
            if chain.response == 2:
                # The impulse of the wall in the first section of the filter.
                state[5] += CUT_OFF**2 * ratio * jump
            begin = max(low, np.nextafter(begin, 2.0))
    return read[0, ::2], read[1, ::2]


def recorded(read: tuple[NDArray[np.float64], ...], chain: Chain, seed: int) -> list[NDArray[np.float64]]:
    """Return the channels as a data logger stores them: noise, hum, offset, drift, converter, and a late base."""
    random = np.random.default_rng(seed)
    time = np.arange(len(read[0])) / RATE
    channels = []
    for values in read:
        size = np.std(values) * np.sqrt(2)
        values = values + chain.hum * size * np.sin(2 * np.pi * 50.0 * time + random.uniform(0, 6))
        values += size * (chain.offset + chain.drift * time / time[-1])
        if chain.snr is not None:
            values = values + np.std(values) * 10 ** (-chain.snr / 20) * random.normal(size=len(time))
        if chain.bits is not None:
            lsb = 2 * 1.5 * np.abs(values).max() / 2**chain.bits
            values = np.round(values / lsb) * lsb
        channels.append(values)
    if chain.late:
        channels = [channels[0][chain.late :], channels[1][: -chain.late]]
    return channels


def write(file: Path, channels: list[NDArray[np.float64]], chain: Chain) -> None:
    """Write CSV; accelerations are in g."""
    units = [("mm", 1e3), ("mm/s", 1e3), ("g", 1 / GRAVITY)]
    (name, response), (other, base) = units[chain.response], units[chain.base]
    table = np.column_stack([np.arange(len(channels[0])) / RATE, response * channels[0], base * channels[1]])
    header = f"time [s],aq [{name}],base [{other}]"
    np.savetxt(file, table, delimiter=",", header=header, comments="", fmt="%.9g")


CASES = {
    "displacements": Chain(0, 0),
    "accelerations": Chain(),
    "velocity over displacement": Chain(1, 0),
    "acceleration over displacement": Chain(2, 0),
    "accelerations; 12 bit": Chain(bits=12),
    "accelerations; hum of 1 %": Chain(hum=0.01),
    "accelerations; offset and drift": Chain(offset=0.3, drift=0.2),
    "accelerations; base one sample late": Chain(late=1),
    "all of these; but in time": Chain(bits=12, hum=0.01, offset=0.3, drift=0.2),
    "all of these; delay stated": Chain(bits=12, hum=0.01, offset=0.3, drift=0.2, late=1, is_stated=True),
    "all of these": Chain(bits=12, hum=0.01, offset=0.3, drift=0.2, late=1),
}


def main() -> None:
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    truth = {
        "f0": np.sqrt(HIDDEN["k"] / HIDDEN["M"]) / (2 * np.pi),
        "zeta": HIDDEN["c"] / (2 * np.sqrt(HIDDEN["k"] * HIDDEN["M"])),
        "r": HIDDEN["r"],
        "b": HIDDEN["b"],
        "epsilon": HIDDEN["m"] / HIDDEN["M"],
    }
    schedule = levels(12)
    reads: dict[tuple[int, int], tuple[NDArray[np.float64], ...]] = {}
    rows = []
    file = ROOT / "target/foreign.csv"
    for name, chain in CASES.items():
        kind = chain.response, chain.base
        if kind not in reads:
            reads[kind] = simulate(schedule, 60, chain)
        for seed in range(1, seeds + 1):
            write(file, recorded(reads[kind], chain, seed), chain)
            command = [str(VINES), "fit", str(file), "--response", "aq", "--drive", "base"]
            command += ["--set=resonance.sensor='q1'", "--json"]
            if chain.is_stated:
                command.append(f"--late={chain.late / RATE}")
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if not done.stdout.startswith("{"):
                rows.append(f"{name},{seed},{done.stderr.strip().splitlines()[0].replace(',', ';')}")
                print(rows[-1])
                continue
            found = json.loads(done.stdout)
            ideal = next(one for one in found["hypotheses"] if one["hypothesis"] == "ideal cavity")
            parameters = {one["symbol"]: one for one in ideal["parameters"]}
            ratios = [
                f"{(one['value'] - truth[symbol]) / one['uncertainty']:.2f},{one['uncertainty'] / one['value']:.1e}"
                for symbol in PARAMETERS
                for one in [parameters[symbol]]
            ]
            seconds = sum(one["seconds"][1] - one["seconds"][0] for one in found["stretches"] if one["motion"] == "1:1")
            possible = sum(one["excluded"] is None for one in found["hypotheses"])
            verdict = f"{seconds:.1f},{possible},{found['p_value']:.3g},{found['describes']}"
            rows.append(f"{name},{seed},{verdict},{','.join(ratios)}")
            print(rows[-1], flush=True)
    file.unlink()
    columns = ",".join(f"error_{s},u_{s}" for s in PARAMETERS)
    text = "\n".join([f"channels,seed,seconds_1to1,possible,p,describes,{columns}", *rows])
    (ROOT / "validation/foreign_recordings.csv").write_text(text + "\n")


if __name__ == "__main__":
    main()
