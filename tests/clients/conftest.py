"""Fixtures: the packed bench, the lab's own lock, the clients in their environments."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest

from identification import harmonic
from scene import Bench, Tape

ROOT = Path(__file__).parents[2]
MASTERS = Path(__file__).parent / "masters"
pytest_plugins = ["figures"]
# cofmupy accepts a step in which nothing moves by 1e-3, whatever the unit: lengths in millimetres make that little.
MILLIMETRES = ("--set", "plant.b=10.0", "--set", "start.dq2=500.0")


@pytest.fixture(scope="session")
def vines() -> Path:
    """The program, built in release mode."""
    program = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "vines"
    if not program.is_file():
        pytest.exit(f"{program} is missing; run scripts/clients, which builds it", returncode=2)
    return program


@pytest.fixture(scope="session")
def bench(vines: Path, tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Both FMUs and the system file, with the default scene."""
    return pack(vines, tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="session")
def bench_in_millimetres(vines: Path, tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """The same with lengths in millimetres: the numbers of all lengths are a thousand times larger, and no others."""
    return pack(vines, tmp_path_factory.mktemp("millimetres"), *MILLIMETRES)


def pack(vines: Path, folder: Path, *options: str) -> Bench:
    """Packs the bench, for the platforms that scripts/clients was asked for."""
    options = (*options, *os.environ.get("PACK_OPTIONS", "").split("\n"))
    subprocess.run([vines, "pack", "--out", folder, *filter(None, options)], check=True, stdout=subprocess.DEVNULL)
    return Bench(folder)


@pytest.fixture(scope="session")
def own_lock(vines: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, float]:
    """The lock that the lab's own loop finds."""
    command = [vines, "identify", "--json", "--out", tmp_path_factory.mktemp("identify")]
    found = subprocess.run(command, check=True, stdout=subprocess.PIPE)
    return json.loads(found.stdout)["lock"]


def interpreter(client: str) -> Path:
    """The Python of a client's environment."""
    if client == "fmpy":
        return Path(sys.executable)
    environment = ROOT / ".venv-clients" / client
    if not environment.is_dir():
        log = environment.with_suffix(".log")
        words = (
            log.read_text().strip().splitlines()[-1:] if log.is_file() else ["run scripts/clients, which installs it"]
        )
        pytest.skip(f"{client} is not installed: {' '.join(words)}")
    return environment / "bin" / "python"


@pytest.fixture(scope="session")
def play(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str, Bench], Tape]:
    """Runs a master in its client's environment; returns what it recorded."""

    def play(client: str, variant: str, bench: Bench) -> Tape:
        python = interpreter(client)
        path = tmp_path_factory.mktemp("tape") / "tape.json"
        command = [python, MASTERS / f"{client}_master.py", bench.folder, variant, path]
        libraries = {"LD_LIBRARY_PATH": str(python.parents[1] / "lib")}
        done = subprocess.run(command, capture_output=True, text=True, env=os.environ | libraries, timeout=600)
        missing = re.search(r"OSError: (lib\S+): cannot open shared object file", done.stderr)
        if missing:
            pytest.skip(f"{client} needs the system library {missing[1]}")
        assert done.returncode == 0, done.stderr
        return Tape(**json.loads(path.read_text()))

    return play


@dataclass(frozen=True)
class Lock:
    """Detuning, amplitude over b, and impacts per period."""

    sigma: float
    amplitude: float
    impacts_per_period: float


def measure(bench: Bench, tape: Tape) -> Lock:
    plant = bench.values("plant")
    omega0 = sqrt(plant["k"] / plant["M"])
    epsilon = plant["m"] / plant["M"]
    assert len(tape.v) == bench.hold, "the master has recorded the whole hold"
    response = harmonic(np.array(tape.v), bench.step, float(np.mean(tape.omega)))
    periods = (bench.hold - 1) * bench.step * response.omega / (2 * pi)
    return Lock(
        sigma=(response.omega / omega0 - 1) / epsilon,
        amplitude=response.amplitude / plant["b"],
        # Counted between two samples: off by up to one impact.
        impacts_per_period=(tape.impacts[-1] - tape.impacts[0]) / periods,
    )


@pytest.fixture
def check_lock(own_lock: dict[str, float], figure: Callable[..., None]) -> Callable[[str, Bench, Tape], Lock]:
    """Compares a recorded lock with the lab's own."""

    def check_lock(name: str, bench: Bench, tape: Tape) -> Lock:
        lock = measure(bench, tape)
        figure(f"{name}: sigma off the lab's own lock", abs(lock.sigma - own_lock["sigma"]), below=1e-4)
        figure(f"{name}: C off the lab's own lock, relative", abs(lock.amplitude / own_lock["C"] - 1), below=1e-4)
        figure(f"{name}: impacts per period off 2", abs(lock.impacts_per_period - 2), below=0.03)
        return lock

    return check_lock
