"""cofmupy: Jacobi, and the same iterated in every step with both FMUs rolled back to its start."""

from cofmupy import Coordinator
from cofmupy.wrappers import Fmu2Handler

from scene import Bench, Tape, run


class TypedHandler:
    """cofmupy 1.0 reads and writes every variable as Real, which FMI 2.0 forbids: here each keeps its own type."""

    @staticmethod
    def write(handler: Fmu2Handler, name: str, value: list) -> None:
        variable = handler.var_name2attr[name]
        getattr(handler.fmu, f"set{variable.type}")([variable.valueReference], value)

    @staticmethod
    def step(handler: Fmu2Handler, current_time: float, step_size: float, input_dict: dict) -> dict:
        handler.set_variables(input_dict)
        handler.fmu.doStep(currentCommunicationPoint=current_time, communicationStepSize=step_size)
        return handler.get_variables(handler.output_var_names)


Fmu2Handler._set_variable = TypedHandler.write
Fmu2Handler.step = TypedHandler.step


def configuration(bench: Bench, *, iterative: bool) -> dict:
    return {
        "fmus": [
            {
                "id": component,
                "name": component,
                "path": str(bench.fmu(component)),
                "initialization": bench.values(component),
            }
            for component in ("plant", "controller")
        ],
        "connections": [
            {
                "source": {"id": wire.source, "variable": wire.output, "type": "fmu", "unit": ""},
                "target": [{"id": wire.target, "variable": wire.input, "type": "fmu", "unit": ""}],
            }
            for wire in bench.wires
        ],
        "cosim_method": "jacobi",
        "iterative": iterative,
        "edge_sep": " -> ",
    }


def simulate(bench: Bench, *, iterative: bool) -> Tape:
    tape = Tape(notes={"rollbacks": 0})
    roll_back = Fmu2Handler.set_state

    def counted(handler: Fmu2Handler, state) -> None:
        tape.notes["rollbacks"] += 1
        roll_back(handler, state)

    Fmu2Handler.set_state = counted
    coordinator = Coordinator()
    coordinator.start(conf_path=configuration(bench, iterative=iterative))
    master = coordinator.master
    for n in range(bench.steps):
        outputs = master.do_step(bench.step, record_outputs=False)
        if n >= bench.steps - bench.hold:
            plant, controller = outputs["plant"], outputs["controller"]
            tape.record(plant["v"][0], controller["omega"][0], plant["impacts"][0])
    return tape


run(
    {
        "jacobi": lambda bench: simulate(bench, iterative=False),
        "iterative": lambda bench: simulate(bench, iterative=True),
    }
)
