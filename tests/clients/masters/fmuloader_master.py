"""fmuloader: the C functions and nothing else; this file is the master."""

import zipfile
from xml.etree import ElementTree

from fmuloader.fmi2 import Fmi2Slave, Fmi2Type

from scene import Bench, Tape, run


class Part:
    """One FMU: its variables by name, and its instance."""

    def __init__(self, bench: Bench, component: str):
        path = bench.fmu(component)
        with zipfile.ZipFile(path) as archive:
            description = ElementTree.fromstring(archive.read("modelDescription.xml"))
        self.references = {
            one.get("name"): int(one.get("valueReference")) for one in description.iter("ScalarVariable")
        }
        self.slave = Fmi2Slave(path, model_identifier=description.find("CoSimulation").get("modelIdentifier"))
        self.slave.instantiate(component, Fmi2Type.CO_SIMULATION, guid=description.get("guid"))
        self.slave.setup_experiment(start_time=0.0)
        for name, value in bench.values(component).items():
            setter = {float: self.slave.set_real, int: self.slave.set_integer, bool: self.slave.set_boolean}[
                type(value)
            ]
            setter([self.references[name]], [value])
        self.slave.enter_initialization_mode()
        self.slave.exit_initialization_mode()

    def of(self, *names: str) -> list[int]:
        return [self.references[name] for name in names]


def jacobi(bench: Bench) -> Tape:
    plant, controller = Part(bench, "plant"), Part(bench, "controller")
    sensed, driven = plant.of("v", "base"), plant.of("omega", "E")
    sensors, drive, impacts = controller.of("response", "reference"), controller.of("omega", "E"), plant.of("impacts")
    tape, step = Tape(), bench.step
    for n in range(bench.steps):
        readings, command = plant.slave.get_real(sensed), controller.slave.get_real(drive)
        if n >= bench.steps - bench.hold:
            tape.record(readings[0], command[0], plant.slave.get_integer(impacts)[0])
        controller.slave.set_real(sensors, readings)
        plant.slave.set_real(driven, command)
        plant.slave.do_step(n * step, step)
        controller.slave.do_step(n * step, step)
    for part in (plant, controller):
        part.slave.terminate()
        part.slave.free_instance()
    return tape


run({"jacobi": jacobi})
