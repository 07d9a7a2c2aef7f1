"""Gives the FMUs of a run the changes that its scene has happen at given times.

Timed changes use the callback of live changes, `Instance.before_step`, in the Python and the C
loop; a step of an FMU without a change that is due costs one comparison of two numbers.
"""

from __future__ import annotations

import math

import numpy as np

from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.run.open_fmus import LoadedFmus
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.system import Change


def arm(fmus: LoadedFmus) -> None:
    """Have each FMU take its changes before the steps that these are for."""
    for change in fmus.system.changes:
        if change.fmu:
            _Setting(change, fmus.instances[change.fmu], fmus.signals).wait(change.begin)


class _Setting:
    """A change that waits for a step of its FMU, and for the next one as long as it acts. Each step
    of the loop sets what the connection brings before, so that it acts again once this ends."""

    def __init__(self, change: Change, instance: Instance, signals: SignalVector) -> None:
        self._change, self._instance, self._signals = change, instance, signals
        self._set = instance.connect(change.inputs, range(len(change.inputs)))
        self._kept = np.array(change.values) if change.values else None
        self._random = np.random.Generator(np.random.PCG64(change.seed))

    def wait(self, time: float) -> None:
        self._instance.before_step(self, time)

    def __call__(self, now: float) -> None:
        change = self._change
        if change.end is not None and now >= change.end:
            return
        self._set(self._values())
        if change.end is not None:
            self.wait(math.nextafter(now, math.inf))

    def _values(self) -> np.ndarray:
        change, signals = self._change, self._signals
        if change.held is None:
            assert self._kept is not None
            return self._kept
        brought = signals.values[[*signals.places(change.held)]]
        if change.noise:
            return brought + change.noise * self._random.standard_normal(len(brought))
        if self._kept is None:
            self._kept = brought
        return self._kept
