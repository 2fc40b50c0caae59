"""FMUs in FMPy.

Independent: FMPy reads the description and calls the binary through the C interface of FMI 2.0, as
any other simulator does. Nothing of the package runs on this side of the interface.
"""

import tempfile
from contextlib import contextmanager
from functools import cache

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

PERIOD = 0.005  # s


class Fmu:
    """An FMU that another simulator runs, with its variables by their names."""

    def __init__(self, path, folder):
        description = read_model_description(path)
        self._numbers = {v.name: v.valueReference for v in description.modelVariables}
        self.slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="loop",
        )
        self.slave.instantiate(loggingOn=True)
        self._time = 0.0

    def begin(self, start=0.0, **parameters):
        self.slave.setupExperiment(startTime=start)
        self.slave.enterInitializationMode()
        for name, values in parameters.items():
            self.put(name, values)
        self.slave.exitInitializationMode()

    @cache  # noqa: B019  # it lives as long as the FMU
    def numbers(self, name):
        return [n for x, n in self._numbers.items() if x.partition("[")[0] == name]

    def put(self, name, values):
        self.slave.setReal(self.numbers(name), [float(x) for x in values])

    def get(self, name):
        return np.array(self.slave.getReal(self.numbers(name)))

    def step(self, period=PERIOD):
        self.slave.doStep(self._time, period)
        self._time += period


@contextmanager
def running(path):
    with tempfile.TemporaryDirectory() as folder:
        fmu = Fmu(path, extract(path, folder))
        try:
            yield fmu
        finally:
            fmu.slave.freeInstance()
