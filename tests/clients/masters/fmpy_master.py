"""FMPy: its simulator of system files, and its simulator of single FMUs for a container of the pair."""

from fmpy import read_model_description, simulate_fmu
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import Parameter, ParameterSet, read_ssd

from scene import Bench, Tape, run


def system_file(bench: Bench) -> Tape:
    parameters = ParameterSet(name="scene")
    # simulate_ssp applies no bindings of its own, but one set for the whole system: the bound sets, under full names.
    for component in read_ssd(str(bench.system), validate=True).system.elements:
        for binding in component.parameterBindings:
            for values in binding.parameterValues:
                parameters.parameters += [
                    Parameter(name=f"{component.name}.{one.name}", type=one.type, value=one.value)
                    for one in values.parameters
                ]
    rows = simulate_ssp(
        str(bench.system),
        stop_time=(bench.steps - 0.5) * bench.step,
        step_size=bench.step,
        parameter_set=parameters,
    )
    return tape(bench, rows, "plant.v", "controller.omega", "plant.impacts")


def container(bench: Bench) -> Tape:
    path = bench.folder / "container.fmu"
    description = read_model_description(str(path), validate=True)
    # What a wire carries is a local variable of the container; `move.omega` is an input of the controller.
    results = [variable.name for variable in description.modelVariables if variable.causality in ("local", "output")]
    columns = [next(full for full in results if full.split(".")[-1] == name) for name in ("v", "omega", "impacts")]
    rows = simulate_fmu(
        str(path),
        stop_time=bench.steps * bench.step,
        step_size=bench.step,
        output_interval=bench.step,
        output=columns,
        start_values={"active": True},
    )
    return tape(bench, rows, *columns)


def tape(bench: Bench, rows, v: str, omega: str, impacts: str) -> Tape:
    hold = rows[-bench.hold :]
    return Tape(hold[v].tolist(), hold[omega].tolist(), hold[impacts].tolist())


run({"system file": system_file, "container": container})
