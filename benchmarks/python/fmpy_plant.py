"""The plant as an FMU among the peers."""

import sys
import time

from peer import DEADLINE, Failed, Peer


class FmpyPlant(Peer):
    """This plant as an FMU, stepped by FMPy: two inputs set, one step, four outputs read."""

    package = "FMPy"
    fmu = None
    state = (9, 10, 11, 12)

    def __init__(self, scene, setting):
        from fmpy import extract, read_model_description
        from fmpy.fmi2 import FMU2Slave

        super().__init__(scene, setting)
        cls = type(self)
        if cls.fmu is None:
            folder = extract(sys.argv[3])
            cls.fmu = folder, read_model_description(folder)
        folder, description = cls.fmu
        self.slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="rig",
        )
        self.slave.instantiate()
        first = scene["drives"][0]
        self.slave.setupExperiment(startTime=0.0)
        self.slave.setReal(range(6), [self.M, self.k, self.c, self.m, self.b, self.r])
        self.slave.setReal(self.state, self.y)
        self.slave.setReal((8, 7), (first[1], first[0]))
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def step(self, amplitude, omega, duration):
        slave = self.slave
        slave.setReal((8, 7), (omega, amplitude))
        slave.doStep(currentCommunicationPoint=self.time, communicationStepSize=duration)
        self.time += duration
        self.y = slave.getReal(self.state)
        if time.perf_counter() > DEADLINE[0]:
            raise Failed("time limit")

    @property
    def impacts(self):
        return self.slave.getInteger([18])[0]

    @impacts.setter
    def impacts(self, count):
        pass
