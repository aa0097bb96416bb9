"""Start values: what a description declares is what an FMU starts from, under every name of a value."""

import struct
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from fmpy.model_description import ScalarVariable

from component import Component, Fmu
from references import ROOT

CAVITY = ["b_plus=0.011", "theta=0.01", "mu_k=0.003", "r_law=viscoelastic", "r_plus=0.4", "r_minus=0.4", "seed=7"]
"""Parameters of a real cavity."""

PACKED = {
    "LoViNes": ("LoViNes", []),
    "PhaseLock": ("PhaseLock", []),
    "cantilever": ("Structure", ["--scene", "cantilever"]),
    "frame": ("Structure", ["--scene", "frame", "--set", "start.dq2=-0.3", "--set", "start.q2=2e-3"]),
    "real frame": ("Structure", ["--scene", "frame", *(f"--set=plant.{one}" for one in CAVITY)]),
    "shaker-cantilever": ("Structure", ["--scene", "shaker-cantilever"]),
    "slip-table": ("Structure", ["--scene", "slip-table"]),
}
"""FMU and arguments of vines pack."""

INPUTS = {
    "LoViNes": {"E": 1e-4, "omega": 55.4},
    "PhaseLock": {"active": True},
    "cantilever": {"E": 1e-4, "omega": 54.8},
    "frame": {"F_amplitude": 1.2, "omega": 54.8},
    "real frame": {"F_amplitude": 1.2, "omega": 54.8},
    "shaker-cantilever": {"u_amplitude": 3.0, "omega": 53.0},
    "slip-table": {"u_amplitude": 2.0, "omega": 54.8},
}
"""Inputs that are set after all start values, so that something moves."""


@pytest.fixture(scope="module", params=PACKED)
def packed(request: pytest.FixtureRequest, vines: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Fmu]:
    name, arguments = PACKED[request.param]
    arguments = [str(ROOT / "scenes" / f"{one}.toml") if one in PACKED else one for one in arguments]
    folder = tmp_path_factory.mktemp("packed")
    subprocess.run([vines, "pack", *arguments, "--out", folder], check=True, stdout=subprocess.DEVNULL)
    return request.param, Fmu.unpack(folder / f"{name}.fmu", folder / name)


def starts(fmu: Fmu) -> dict[str, float]:
    """The declared start values of all variables that may be set before initialization, in the description's order."""

    def value(variable: ScalarVariable) -> float:
        if variable.type == "Boolean":
            return variable.start == "true"
        return float(variable.start) if variable.type == "Real" else int(variable.start)

    return {one.name: value(one) for one in fmu.description.modelVariables if one.start is not None}


def trajectory(fmu: Fmu, inputs: dict[str, float], values: dict[str, float]) -> Iterator[bytes]:
    """The bits of all outputs, step by step, of an instance in which these values were set first."""
    with closing(Component(fmu)) as rig:
        rig.start(values | inputs)
        for n in range(400):
            if "response" in fmu.names("input"):
                rig.set({"response": 1e-3 * ((n % 20) / 10 - 1)})
            rig.step(1e-3)
            outputs = rig.outputs().values()
            yield b"".join(struct.pack("d" if isinstance(one, float) else "q", one) for one in outputs)


def test_declared_starts_written_back_in_any_order_change_no_bit_of_the_trajectory(packed):
    name, fmu = packed
    declared = starts(fmu)
    assert len(declared) > 15
    expected = list(trajectory(fmu, INPUTS[name], {}))
    assert len(set(expected)) > 200
    assert list(trajectory(fmu, INPUTS[name], declared)) == expected
    assert list(trajectory(fmu, INPUTS[name], dict(reversed(declared.items())))) == expected


def test_an_instance_reads_back_the_declared_starts(packed):
    _, fmu = packed
    declared = starts(fmu)
    with ExitStack() as stack:
        for values in ({}, declared):
            rig = Component(fmu)
            stack.callback(rig.close)
            rig.slave.setupExperiment()
            rig.set(values)
            rig.slave.enterInitializationMode()
            assert {one: rig.get(one) for one in declared} == declared
