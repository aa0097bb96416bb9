"""fmu-manipulation-toolbox: checks both FMUs, and puts them into one container that any master can step."""

import logging
from pathlib import Path

from fmu_manipulation_toolbox.assembly import AssemblyNode
from fmu_manipulation_toolbox.checker import get_checkers
from fmu_manipulation_toolbox.operations import FMU

from scene import Bench, Tape, run


class Complaints(logging.Handler):
    """Keeps what the toolbox warns of."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.lines: list[str] = []
        logging.getLogger("fmu_manipulation_toolbox").addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage())


def check(bench: Bench) -> Tape:
    complaints = Complaints()
    for component in ("plant", "controller"):
        fmu = FMU(str(bench.fmu(component)))
        for checker in get_checkers():
            fmu.apply_operation(checker())
    return Tape(notes={"complaints": complaints.lines})


def container(bench: Bench, *, threads: bool) -> Tape:
    node = AssemblyNode("container.fmu", step_size=bench.step, mt=threads, auto_link=False)
    names = {component: bench.fmu(component).name for component in ("plant", "controller")}
    for component, name in names.items():
        node.add_fmu(name)
        for variable, value in bench.values(component).items():
            node.add_start_value(name, variable, value)
    for wire in bench.wires:
        node.add_link(names[wire.source], wire.output, names[wire.target], wire.input)
    node.make_fmu(Path(bench.folder))
    return Tape()


run(
    {
        "check": check,
        "container": lambda bench: container(bench, threads=False),
        "container with threads": lambda bench: container(bench, threads=True),
    }
)
