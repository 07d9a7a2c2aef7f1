"""An FMU instance driven by variable names."""

from __future__ import annotations

from fmpy.fmi2 import FMU2Slave

from hapticlink.fmus.check import FmuSession


class Named:
    """One instance of an opened FMU."""

    def __init__(self, at: FmuSession, name: str = "instance") -> None:
        self.at = at
        self.slave: FMU2Slave = at.instance(name)
        self.references = {v.name: v.valueReference for v in at.description.modelVariables}

    def set(self, **values: float) -> None:
        self.slave.setReal([self.references[n] for n in values], list(values.values()))

    def get(self, *names: str) -> list[float]:
        return self.slave.getReal([self.references[n] for n in names])

    def start(self, time: float = 0.0, stop: float | None = None) -> Named:
        self.slave.setupExperiment(startTime=time, stopTime=stop)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        return self

    def step(self, time: float, size: float) -> None:
        self.slave.doStep(time, size)
