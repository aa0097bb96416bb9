"""pathsim-fmi: both FMUs as blocks of a block diagram."""

from pathsim import Connection, Simulation
from pathsim_fmi import CoSimulationFMU, FMUWrapper

from scene import Bench, Tape, run

ports = FMUWrapper._build_variable_maps


def real_ports(wrapper: FMUWrapper) -> None:
    """pathsim-fmi 0.1 reads and writes every port as Real, which FMI 2.0 forbids for others: the others get no port."""
    ports(wrapper)
    kinds = {variable.name: variable.type for variable in wrapper.model_description.modelVariables}
    for references in (wrapper.input_refs, wrapper.output_refs):
        for name in [name for name in references if kinds[name] != "Real"]:
            del references[name]


FMUWrapper._build_variable_maps = real_ports


def diagram(bench: Bench) -> Tape:
    plant, controller = (
        CoSimulationFMU(str(bench.fmu(name)), name, start_values=bench.values(name), dt=bench.step)
        for name in ("plant", "controller")
    )
    blocks = {"plant": plant, "controller": controller}
    wires = [Connection(blocks[wire.source][wire.output], blocks[wire.target][wire.input]) for wire in bench.wires]
    simulation = Simulation(list(blocks.values()), wires, dt=bench.step, log=False)
    wrapper = plant.fmu_wrapper
    impacts = [wrapper.variable_map["impacts"].valueReference]
    tape = Tape()
    for n in range(bench.steps):
        simulation.timestep()
        if n >= bench.steps - bench.hold:
            tape.record(plant.outputs["v"], controller.outputs["omega"], wrapper.fmu.getInteger(impacts)[0])
    return tape


run({"diagram": diagram})
