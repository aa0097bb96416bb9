"""Fixtures: the packed FMUs, instances of them, experiments that tests share, and the table of figures at the end."""

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

FIGURES = pytest.StashKey[list[tuple[str, str, str]]]()


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


@pytest.fixture
def figure(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Notes a measured figure for the table at the end, and checks it against its limits."""
    figures = request.config.stash[FIGURES]

    def check(
        what: str, value: float, *, below: float | None = None, between: tuple[float, float] | None = None
    ) -> None:
        low, high = between or (-float("inf"), below)
        limit = f"{low:g} to {high:g}" if between else f"at most {high:g}"
        figures.append((what, f"{value:.4g}", limit))
        assert low <= value <= high, f"{what}: {value} is not {limit}"

    return check


def pytest_configure(config: pytest.Config) -> None:
    config.stash[FIGURES] = []


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    figures = config.stash[FIGURES]
    if not figures:
        return
    terminalreporter.section("figures")
    rows = [("what", "figure", "limit"), *figures]
    wide = [max(len(row[n]) for row in rows) for n in range(2)]
    for what, value, limit in rows:
        terminalreporter.write_line(f"{what:<{wide[0]}}  {value:>{wide[1]}}  {limit}")
