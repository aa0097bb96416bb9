"""The bench as its system file describes it, and the tape that a master fills.

Every master runs in an environment of its own that holds its package alone: this file needs the standard library only.
"""

import argparse
import json
import zipfile
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

SSP = "{http://ssp-standard.org/SSP1/SystemStructure"
READ = {"Real": float, "Integer": int, "Boolean": lambda text: text == "true"}
HOLD_PERIODS = 20
SAMPLES_PER_PERIOD = 100


@dataclass(frozen=True)
class Wire:
    """A connection from an output to an input."""

    source: str
    output: str
    target: str
    input: str


@dataclass(frozen=True)
class Bench:
    """A folder with both FMUs and the system file that couples them."""

    folder: Path

    @property
    def system(self) -> Path:
        return self.folder / "bench.ssp"

    def fmu(self, component: str) -> Path:
        return self.folder / {"plant": "LoViNes.fmu", "controller": "PhaseLock.fmu"}[component]

    @cached_property
    def structure(self) -> ElementTree.Element:
        return self._xml("SystemStructure.ssd")

    def _xml(self, name: str) -> ElementTree.Element:
        with zipfile.ZipFile(self.system) as archive:
            return ElementTree.fromstring(archive.read(name))

    def values(self, component: str) -> dict[str, float | int | bool]:
        """Parameters and start values, by the names of the variables."""
        return {
            parameter.get("name"): READ[value.tag.split("}")[1]](value.get("value"))
            for parameter in self._xml(f"resources/{component}.ssv").iter(f"{SSP}ParameterValues}}Parameter")
            for value in parameter
        }

    @property
    def wires(self) -> list[Wire]:
        names = ("startElement", "startConnector", "endElement", "endConnector")
        connections = self.structure.iter(f"{SSP}Description}}Connection")
        return [Wire(*(connection.get(name) for name in names)) for connection in connections]

    @cached_property
    def step(self) -> float:
        """The communication step: the controller's sample time."""
        return self.values("controller")["sample_time"]

    @cached_property
    def steps(self) -> int:
        """Steps in the default experiment."""
        (experiment,) = self.structure.iter(f"{SSP}Description}}DefaultExperiment")
        return round(float(experiment.get("stopTime")) / self.step)

    @property
    def hold(self) -> int:
        """Steps at the end of it over which the lock is measured."""
        return HOLD_PERIODS * SAMPLES_PER_PERIOD


@dataclass
class Tape:
    """What is recorded over the hold, sample by sample, and what else a master has to say."""

    v: list[float] = field(default_factory=list)
    omega: list[float] = field(default_factory=list)
    impacts: list[int] = field(default_factory=list)
    notes: dict = field(default_factory=dict)

    def record(self, v: float, omega: float, impacts: int) -> None:
        self.v.append(float(v))
        self.omega.append(float(omega))
        self.impacts.append(int(impacts))


def run(masters: dict) -> None:
    """Runs the master asked for, a function from a bench to a tape, with the bench of a folder."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("variant")
    parser.add_argument("tape", type=Path)
    given = parser.parse_args()
    tape = masters[given.variant](Bench(given.folder))
    given.tape.write_text(json.dumps(vars(tape)))
