"""ecospy: a C++ engine, with the system read from bench.ssp and with the same built call by call."""

from ecospy import EcosSimulation, EcosSimulationStructure

from scene import Bench, Tape, run


def simulate(bench: Bench, simulation: EcosSimulation, parameter_set: str | None = None) -> Tape:
    tape = Tape()
    if not simulation.init(parameter_set=parameter_set):
        raise RuntimeError("ecos did not initialise the system")
    simulation.step(bench.steps - bench.hold)
    for _ in range(bench.hold):
        tape.record(
            simulation.get_real("plant::v"),
            simulation.get_real("controller::omega"),
            simulation.get_integer("plant::impacts"),
        )
        simulation.step()
    simulation.terminate()
    return tape


def system_file(bench: Bench) -> Tape:
    with EcosSimulation(step_size=bench.step, ssp_path=str(bench.system)) as simulation:
        # ecos applies one set of parameters by its name, and each component of the file has a set of its own.
        setters = {float: simulation.set_real, int: simulation.set_integer, bool: simulation.set_bool}
        for component in ("plant", "controller"):
            for name, value in bench.values(component).items():
                setters[type(value)](f"{component}::{name}", value)
        return simulate(bench, simulation)


def call_by_call(bench: Bench) -> Tape:
    with EcosSimulationStructure() as structure:
        parameters = {}
        for component in ("plant", "controller"):
            structure.add_model(component, bench.fmu(component))
            parameters |= {f"{component}::{name}": value for name, value in bench.values(component).items()}
        structure.add_parameter_set("scene", parameters)
        for wire in bench.wires:
            structure.make_real_connection(f"{wire.source}::{wire.output}", f"{wire.target}::{wire.input}")
        with EcosSimulation(step_size=bench.step, structure=structure) as simulation:
            return simulate(bench, simulation, "scene")


run({"system file": system_file, "call by call": call_by_call})
