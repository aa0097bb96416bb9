"""One instance of an FMU, handled as a plain master handles it: through the C interface, by name."""

import ctypes
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from weakref import WeakValueDictionary
from xml.etree import ElementTree

import fmpy
import numpy as np
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, addLoggerProxy, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.model_description import ModelDescription, ScalarVariable
from fmpy.util import read_csv

__all__ = ["Component", "FMICallException", "Fmu", "Group", "Message", "own_experiment"]

C_TYPES = {"Real": ctypes.c_double, "Integer": ctypes.c_int, "Boolean": ctypes.c_int}


@dataclass(frozen=True)
class Fmu:
    """A packed FMU, its unpacked copy and what it says of itself."""

    path: Path
    folder: Path
    description: ModelDescription

    @classmethod
    def unpack(cls, path: Path, folder: Path) -> "Fmu":
        fmpy.extract(str(path), str(folder))
        return cls(path, folder, fmpy.read_model_description(str(folder), validate=True))

    def variable(self, name: str) -> ScalarVariable:
        return next(one for one in self.description.modelVariables if one.name == name)

    def names(self, causality: str) -> list[str]:
        return [one.name for one in self.description.modelVariables if one.causality == causality]


@dataclass(frozen=True)
class Message:
    """What an FMU told its logger."""

    status: int
    category: str
    text: str


class Group:
    """Variables of one type that are read or written together; names are looked up once."""

    def __init__(self, component: "Component", names: Iterable[str]):
        variables = [component.fmu.variable(name) for name in names]
        (kind,) = {variable.type for variable in variables}
        slave = component.slave
        self.count = len(variables)
        self.references = (ctypes.c_uint * self.count)(*[variable.valueReference for variable in variables])
        self.values = (C_TYPES[kind] * self.count)()
        self.instance = slave.component
        self.getter, self.setter = getattr(slave, f"fmi2Get{kind}"), getattr(slave, f"fmi2Set{kind}")

    def get(self) -> list[float] | list[int]:
        self.getter(self.instance, self.references, self.count, self.values)
        return self.values[:]

    def set(self, *values: float) -> None:
        self.values[:] = values
        self.setter(self.instance, self.references, self.count, self.values)


def _hear(environment, _instance, status, category, text) -> None:
    component = _COMPONENTS.get(environment)
    if component is not None:
        component.messages.append(Message(status, category.decode(), text.decode()))


# FMPy's proxy expands a message as printf does, so that a stray % would show; it knows one logger for all instances.
_COMPONENTS: WeakValueDictionary[int, "Component"] = WeakValueDictionary()
_LOGGER = fmi2CallbackLoggerTYPE(_hear)


class Component:
    """An instance with its clock and its log; a refused call raises FMICallException."""

    def __init__(self, fmu: Fmu, *, logging: bool = False):
        self.fmu = fmu
        self.time = 0.0
        self.messages: list[Message] = []
        self.slave = FMU2Slave(
            guid=fmu.description.guid,
            modelIdentifier=fmu.description.coSimulation.modelIdentifier,
            unzipDirectory=str(fmu.folder),
            instanceName="instance",
        )
        _COMPONENTS[id(self)] = self
        callbacks = fmi2CallbackFunctions(logger=_LOGGER, componentEnvironment=id(self))
        addLoggerProxy(ctypes.byref(callbacks))
        self.slave.instantiate(callbacks=callbacks, loggingOn=logging)

    def close(self) -> None:
        self.slave.freeInstance()

    def start(self, values: Mapping[str, float] | None = None, *, time: float = 0.0, stop: float | None = None):
        """Sets start values and initialises; returns the component."""
        self.slave.setupExperiment(startTime=time, stopTime=stop)
        self.set(values or {})
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.time = time
        return self

    def group(self, *names: str) -> Group:
        return Group(self, names)

    def get(self, name: str) -> float | int:
        return self.group(name).get()[0]

    def set(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self.group(name).set(value)

    def outputs(self) -> dict[str, float | int]:
        return {name: self.get(name) for name in self.fmu.names("output")}

    def step(self, length: float, count: int = 1) -> None:
        """Takes steps of one length, the clock counted from where it stands now."""
        start = self.time
        for n in range(count):
            self.slave.doStep(start + n * length, length)
        self.time = start + count * length


def own_experiment(fmu: Fmu) -> tuple[np.ndarray, dict[str, float]]:
    """What the experiment inside an FMU gives, and how far its columns are off the references beside it, relative."""
    manifest = fmu.folder / "extra" / "org.fmi-standard.fmi-ls-ref" / "fmi-ls-manifest.xml"
    (related,) = ElementTree.parse(manifest).getroot()
    assert related.get("role") == "experiment/smoke-test"
    file = manifest.parent / related.get("source")
    (experiment,) = ElementTree.parse(file).getroot()
    files = {element.tag: file.parent / element.get("source") for element in experiment}
    values = {
        parameter.get("name"): parameter[0].get("value")
        for parameter in ElementTree.parse(files["Parameters"]).getroot()[0]
    }
    expected = np.genfromtxt(files["References"], delimiter=",", names=True)
    columns = expected.dtype.names[1:]
    found = simulate_fmu(
        str(fmu.path),
        stop_time=float(experiment.get("stopTime")),
        output_interval=float(experiment.get("stepSize")),
        start_values=values,
        input=read_csv(files["Stimuli"]),
        output=columns,
        fmi_type="CoSimulation",
    )
    rows = np.searchsorted(found["time"], expected["time"] - float(experiment.get("stepSize")) / 2)
    off = {name: np.abs(found[name][rows] - expected[name]).max() / np.abs(expected[name]).max() for name in columns}
    return found, off
