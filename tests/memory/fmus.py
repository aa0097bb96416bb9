"""Simulates FMUs with FMPy, and makes calls that few masters make: `scripts/stress --memory` runs it in a checker."""

import sys
import tempfile

import numpy as np
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave

START = {
    "LoViNes": {"der(q2)": 0.5, "E": 9.2e-5, "omega": 54.9},
    "PhaseLock": {"active": True},
    "Structure": {"E": 1e-4, "omega": 54.8},
}
STEP = 1e-3


def states(path: str, description) -> None:
    """FMU states are kept, saved, restored and freed; a wrong call is refused; a reset and a second instance follow."""
    outputs = [v.valueReference for v in description.modelVariables if v.causality == "output" and v.type == "Real"]
    model = description.coSimulation.modelIdentifier
    with tempfile.TemporaryDirectory() as folder:
        extract(path, folder)
        instances = [
            FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier=model, instanceName=name)
            for name in ("first", "second")
        ]
        for fmu in instances:
            fmu.instantiate(loggingOn=True)
        for fmu in instances * 2:
            fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
            for n in range(100):
                fmu.doStep(n * STEP, STEP)
            state = fmu.getFMUState()
            before = fmu.getReal(outputs)
            saved = fmu.serializeFMUState(state)
            fmu.doStep(100 * STEP, STEP)
            restored = fmu.deserializeFMUState(saved)
            fmu.setFMUState(restored)
            np.testing.assert_array_equal(fmu.getReal(outputs), before)
            fmu.freeFMUState(state)
            fmu.freeFMUState(restored)
            try:
                fmu.setReal([2**32 - 1], [0.0])
            except FMICallException:
                pass
            else:
                raise AssertionError("an unknown variable was set")
            fmu.reset()
        for fmu in instances:
            fmu.freeInstance()


for path in sys.argv[1:]:
    description = read_model_description(path)
    start = START[description.coSimulation.modelIdentifier]
    for interface in ("CoSimulation", "ModelExchange"):
        if interface == "CoSimulation" or description.modelExchange is not None:
            simulate_fmu(path, fmi_type=interface, stop_time=0.5, output_interval=STEP, start_values=start)
    states(path, description)
    print(f"{description.coSimulation.modelIdentifier}: simulated; states kept, saved and restored")
