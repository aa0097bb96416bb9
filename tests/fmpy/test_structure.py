"""Structure.fmu of presets: valid for FMPy, and simulated in steps of any length."""

import json
import math
import subprocess
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from component import Component, FMICallException, Fmu, own_experiment
from references import ROOT

POINTS = [f"{quantity}[{{}}]" for quantity in "qva"]

DRIVES = {
    "cantilever": {"E": 1e-4, "omega": 54.8},
    "frame": {"F_amplitude": 1.2, "omega": 54.8},
    "shaker-cantilever": {"u_amplitude": 3.0, "omega": 53.0},
    "slip-table": {"u_amplitude": 2.0, "omega": 54.8},
}
"""Inputs near the lowest frequency that make the particle hit the walls."""


@pytest.fixture(scope="module", params=DRIVES)
def preset(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def pack(vines: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Fmu]:
    def pack(preset: str, *settings: str) -> Fmu:
        # A path that masters have to encode.
        folder = tmp_path_factory.mktemp("größe 1")
        scene = ROOT / "scenes" / f"{preset}.toml"
        changes = [argument for setting in settings for argument in ("--set", setting)]
        command = [vines, "pack", "--scene", scene, *changes, "--out", folder]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        assert sorted(path.name for path in folder.iterdir()) == ["PhaseLock.fmu", "Structure.fmu"]
        return Fmu.unpack(folder / "Structure.fmu", folder / "unpacked")

    return pack


@pytest.fixture(scope="module")
def structure(preset: str, pack: Callable[..., Fmu]) -> Fmu:
    return pack(preset)


def described(fmu: Fmu) -> dict:
    return json.loads((fmu.folder / "resources" / "structure.json").read_text())


def test_the_description_is_valid_and_has_outputs_at_the_points(structure):
    assert validate_fmu(str(structure.path)) == []
    points = [point["name"] for point in described(structure)["points"]]
    expected = [name.format(point) for point in points if point not in ("force", "current") for name in POINTS]
    assert [name for name in structure.names("output") if "[" in name] == expected
    assert "M" not in structure.names("parameter")


def test_the_experiment_inside_it_gives_the_results_beside_it_and_has_impacts(structure):
    found, errors = own_experiment(structure)
    assert max(errors.values()) < 1e-9, errors
    assert found["impacts"][-1] >= 5


def direct(structure: dict, drive: dict[str, float], dq2: float, times: np.ndarray) -> tuple[np.ndarray, int]:
    """Displacement of the cavity at these times, and the number of impacts: by closed form and bisection."""
    amplitude, omega = drive.values()
    m, b, r = (structure["parameters"][name] for name in ("m", "b", "r"))
    natural, zeta, cavity, driven = np.array([list(mode.values()) for mode in structure["equations"]["modes"]]).T
    pole = natural * (-zeta + 1j * np.sqrt(1 - zeta**2))
    is_base = structure["excitation"] == "Base"
    per_drive = driven * (natural**2 + 2j * zeta * natural * omega if is_base else 1)
    steady = amplitude * per_drive / (natural**2 - omega**2 + 2j * zeta * natural * omega)
    begin, eta, speed, q2 = 0.0, np.zeros(len(pole)), np.zeros(len(pole)), 0.0

    def modes(t: float) -> tuple[np.ndarray, np.ndarray]:
        harmonic = steady * np.exp(1j * omega * t)
        at_begin = steady * np.exp(1j * omega * begin)
        x, v = eta - at_begin.imag, speed - (1j * omega * at_begin).imag
        free = (x - 1j * (v - pole.real * x) / pole.imag) * np.exp(pole * (t - begin))
        return free.real + harmonic.imag, (pole * free).real + (1j * omega * harmonic).imag

    def w(t: float) -> float:
        return cavity @ modes(t)[0] - q2 - dq2 * (t - begin)

    q1, impacts = [], 0
    for before, after in zip([0.0, *times[:-1]], times, strict=True):
        while abs(w(after)) > b:
            low, high = max(before, begin), after
            while high - low > 1e-15:
                middle = 0.5 * (low + high)
                low, high = (low, middle) if abs(w(middle)) > b else (middle, high)
                if middle in (before, after):
                    break
            (eta, speed), q2 = modes(low), q2 + dq2 * (low - begin)
            impulse = -(1 + r) * (cavity @ speed - dq2) / (cavity @ cavity + 1 / m)
            begin, speed, dq2, impacts = low, speed + cavity * impulse, dq2 - impulse / m, impacts + 1
        q1.append(cavity @ modes(after)[0])
    return np.array(q1), impacts


@pytest.mark.parametrize("name", ["cantilever", "frame"])
def test_fmpy_plays_the_motion_of_a_direct_simulation(pack, name):
    structure, start = pack(name), DRIVES[name]
    known = described(structure)
    at_cavity = [[mode["cavity"], 0.0] for mode in known["equations"]["modes"]]
    output = next(f"q[{point['name']}]" for point in known["points"] if point["row"] == at_cavity)
    settings = {
        "start_values": start | {"der(q2)": 0.5},
        "output": [output, "impacts"],
        "output_interval": 1e-3,
        "stop_time": 2.5,
    }
    result = simulate_fmu(str(structure.path), **settings)
    expected, impacts = direct(known, start, 0.5, result["time"])
    assert result["impacts"][-1] == impacts > 10
    assert result[output] == pytest.approx(expected, abs=1e-9 * max(abs(expected)))


def test_fmpy_simulates_it_and_steps_of_any_length_agree(structure, preset):
    point = described(structure)["points"][0]["name"]
    outputs = [name.format(point) for name in POINTS] + ["q2", "impacts"]
    start = DRIVES[preset] | {"der(q2)": 0.5}
    result = simulate_fmu(str(structure.path), stop_time=3, output_interval=1e-3, start_values=start, output=outputs)
    assert result["impacts"][-1] > 10
    with closing(Component(structure)) as coarse:
        coarse.start(start)
        coarse.step(0.5, 6)
        assert coarse.get("impacts") == result["impacts"][-1]
        for name in outputs[:-1]:
            size = max(map(abs, result[name].tolist()))
            assert coarse.get(name) == pytest.approx(float(result[name][-1]), abs=1e-7 * size)


def test_the_outputs_of_a_shaker_obey_its_equations_while_the_command_is_clipped(pack):
    mass, (stiffness, damping), (stinger, stinger_damping) = 0.057, (9932.0, 21.5), (1e5, 0.5)
    resistance, force_factor = 2.0, 6.78
    with closing(Component(pack("shaker-cantilever", "shaker.voltage_max=6"))) as rig:
        rig.start({"u_amplitude": 8.0, "omega": 53.0, "der(q2)": 0.5})
        clipped = 0
        for n in range(1, 3000):
            rig.step(1e-3)
            command, current, force = rig.group("command", "current", "force").get()
            x, v, a, y, dy = rig.group(*(f"{name}[armature]" for name in "qva"), "q[root]", "v[root]").get()
            expected = 8.0 * math.sin(53.0 * n * 1e-3)
            clipped += abs(expected) > 6.0
            assert command == pytest.approx(max(-6.0, min(6.0, expected)), abs=1e-9)
            assert current == pytest.approx((command - force_factor * v) / resistance, abs=1e-9)
            assert force == pytest.approx(stinger * (x - y) + stinger_damping * (v - dy), abs=1e-7)
            forces = force_factor * current - damping * v - stiffness * x - force
            assert mass * a == pytest.approx(forces, abs=1e-7)
        assert clipped > 1000
        assert rig.get("impacts") > 10


def test_a_shaker_that_reaches_its_limit_ends_the_simulation_in_one_sentence(pack):
    with closing(Component(pack("shaker-cantilever", "plant.b=1e-3", "shaker.stroke_max=1e-4"), logging=True)) as rig:
        rig.start({"u_amplitude": 8.0, "omega": 53.0})
        with pytest.raises(FMICallException):
            rig.step(1e-3, 1000)
        assert "the shaker reached its limit: the armature is" in rig.messages[-1].text
        assert "0.0001 is allowed" in rig.messages[-1].text


def test_a_limit_passed_within_a_step_ends_that_step_with_an_error(pack):
    start, step = {"u_amplitude": 8.0, "omega": 53.0}, 1e-3
    period = 2 * math.pi / 53.0
    with closing(Component(pack("shaker-cantilever"))) as free:
        free.start(start)
        # The force at every sample, and at the ends of steps of a period.
        forces = []
        for _ in range(200):
            free.step(step)
            forces.append(abs(free.get("force")))
    with closing(Component(pack("shaker-cantilever"))) as free:
        free.start(start)
        free.step(period)
        at_point = abs(free.get("force"))
    limit = 0.5 * (at_point + max(forces[: int(period / step)]))
    assert at_point < 0.8 * limit
    limited = pack("shaker-cantilever", f"shaker.force_max={limit}")
    first = next(n for n, force in enumerate(forces) if force > limit)
    assert first * step < period
    meaning = limited.variable("force").description
    assert f"beyond {limit} N to either side the simulation ends with an error" in meaning
    for length in (period, step):
        with closing(Component(limited, logging=True)) as rig:
            rig.start(start)
            with pytest.raises(FMICallException):
                rig.step(length, 200)
            text = rig.messages[-1].text
            assert "the shaker reached its limit: the force is" in text
            assert float(text.split("at t = ")[1].split(" s")[0]) == pytest.approx((first + 1) * step, abs=2.5 * step)
            assert abs(rig.get("force")) > limit
