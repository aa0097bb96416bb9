"""Fixtures: the packed FMUs, instances of them, and experiments that tests share."""

import os
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from pathlib import Path

import pytest

from component import Component, Fmu
from coupling import SAMPLE_TIME, Pair, Record, Scene, experiment
from references import ROOT

pytest_plugins = ["figures"]


@pytest.fixture(scope="session")
def vines() -> Path:
    """The program, built in release mode."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", "target"))
    program = ROOT / target / "release" / "vines"
    if not program.is_file():
        pytest.exit(f"{program} is missing; run scripts/test, which builds it first", returncode=2)
    return program


@pytest.fixture(scope="session")
def fmus(vines: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Fmu]:
    """Both FMUs, freshly packed."""
    folder = tmp_path_factory.mktemp("fmus")
    subprocess.run([vines, "pack", "--out", folder], check=True, stdout=subprocess.DEVNULL)
    return {name: Fmu.unpack(folder / f"{name}.fmu", folder / name) for name in ("LoViNes", "PhaseLock")}


@pytest.fixture
def instance(fmus: dict[str, Fmu]) -> Iterator[Callable[..., Component]]:
    """Makes instances by name; they are freed after the test."""
    with ExitStack() as stack:

        def make(name: str, *, logging: bool = False) -> Component:
            component = Component(fmus[name], logging=logging)
            stack.callback(component.close)
            return component

        yield make


@pytest.fixture(scope="session")
def run(fmus: dict[str, Fmu]) -> Callable[..., Record]:
    """Runs an experiment with the pair, with other settings of the controller where given; each is run once."""

    @cache
    def run(scene: Scene, step: float = SAMPLE_TIME, settings: tuple = (), **coupling: bool) -> Record:
        with ExitStack() as stack:
            plant, controller = Component(fmus["LoViNes"]), Component(fmus["PhaseLock"])
            stack.callback(plant.close)
            stack.callback(controller.close)
            plant.start(scene.plant())
            connected = {"reference_connected": coupling.get("reference", True)}
            controller.start(scene.controller() | connected | dict(settings))
            return experiment(Pair(plant, controller, step, **coupling), scene)

    return run
