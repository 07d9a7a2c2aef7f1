"""Gives the FMUs of a run what is changed of their inputs and parameters, at times that the scene
has or as somebody asks for it meanwhile.

An FMU takes it before a step, by the callback of the loop, `Instance.before_step`; a step without a
change that is due costs one comparison of two numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.run.open_fmus import LoadedFmus, refuse_text
from hapticlink.orchestrator.system.system import InputChange


class InputSetter:
    """A change that waits for a step of its FMU, and for the next one as long as it acts. Each step
    of the loop sets what the connection brings before, so that it acts again once this ends.

    values: what is set; None until `held` has brought it.
    """

    def __init__(self, change: InputChange, fmus: LoadedFmus) -> None:
        self._change, self._signals = change, fmus.signals
        self._instance = fmus.instances[change.fmu]
        refuse_text(change, fmus.isolated)
        self._set = self._instance.connect(change.inputs, range(len(change.inputs)))
        self.values = np.array(change.values) if change.values else None
        self._random = np.random.Generator(np.random.PCG64(change.seed))

    def wait(self, time: float = -math.inf) -> None:
        """Act before the first step that begins at `time` (s) or later."""
        self._instance.before_step(self, time)

    def saved(self) -> dict[str, Any]:
        """From when on it waits, what it sets and what it draws, and the inputs."""
        return {
            "due": self._instance.due_time(self),
            "values": self.values,
            "drawn": self._random.bit_generator.state,
            "inputs": [f"{self._change.fmu}.{s.name}" for s in self._change.inputs],
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Wait, set and draw as that did."""
        values, size = saved["values"], len(self._change.inputs)
        self.values = None if values is None else np.array(values, np.float64).reshape(size)
        self._random.bit_generator.state = saved["drawn"]
        if saved["due"] is not None:
            self.wait(saved["due"])

    def __call__(self, now: float) -> None:
        change = self._change
        if change.end is not None and now >= change.end:
            return
        self._set(self._values())
        if change.end is not None:
            self.wait(math.nextafter(now, math.inf))

    def _values(self) -> Vector:
        change, signals = self._change, self._signals
        if change.noise and change.held:
            brought = signals.values[[*signals.places(change.held)]]
            return brought + change.noise * self._random.standard_normal(len(brought))
        if self.values is None:
            assert change.held is not None
            self.values = signals.values[[*signals.places(change.held)]]
        return self.values
