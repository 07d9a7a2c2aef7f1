"""The differences of an FMI 3.0 co-simulation FMU from one of FMI 2.0. Those of one with event mode
are in `event_mode`.

Intermediate update is not used: inputs are constant over each step (FMI 3.0 section 4.2.1)."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from fmpy import fmi3

from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.fmi.messages import keep_message
from hapticlink.orchestrator.fmi.setter import Setting
from hapticlink.orchestrator.fmi.start_values import find_wide_integers
from hapticlink.orchestrator.fmi.status import succeeded
from hapticlink.orchestrator.fmi.transfer import as_signal
from hapticlink.orchestrator.fmi.variables import TYPES, Scalar


class InProcess3(InProcess):
    """An FMU of FMI 3.0 whose library is loaded into this process."""

    _library = fmi3.FMU3Slave

    def _logging(self) -> dict[str, Any]:
        def log(environment: int | None, status: int, category: bytes, message: bytes) -> None:
            keep_message(self._key, status, message, category)

        return {"logMessage": log}

    def _stepper(self) -> Callable[[float, float], int]:
        do_step, component = self.slave.dll["fmi3DoStep"], self.slave.component
        self.step_flags = [ctypes.c_bool() for _ in range(3)]  # event, terminate, early return
        self.reached = ctypes.c_double()
        flags, last = [ctypes.byref(flag) for flag in self.step_flags], ctypes.byref(self.reached)
        forward, instance = ctypes.c_bool(self.forward), ctypes.c_void_p(component)

        def advance(time: float, size: float) -> int:
            begin, over = ctypes.c_double(time), ctypes.c_double(size)
            status: int = do_step(instance, begin, over, forward, *flags, last)
            return status

        return advance

    def _judge_status(self, status: int, time: float) -> int:
        if succeeded(status):
            _, ends, early = self.step_flags
            if ends:
                self._end(self.reached.value)
            elif early:
                what = f"{self.do_step} returned early, at {self.reached.value:.6g} s, unasked"
                raise self._fault(what, time)
        return status

    def update_discrete_states(self) -> tuple[bool, bool, float]:
        more, ends, _, _, defined = flags = [ctypes.c_bool() for _ in range(5)]
        next_event = ctypes.c_double()
        results = [*(ctypes.byref(flag) for flag in flags), ctypes.byref(next_event)]
        self._call("fmi3UpdateDiscreteStates", *results)
        return more.value, ends.value, next_event.value if defined else math.inf

    def _setting(self, scalars: Sequence[Scalar], start: bool = False) -> Setting:
        """Arrays are set as a whole: entries that are not connected keep their start values. Raises
        FmuFault if such an entry has none, because its array was resized."""
        references = {s.reference for s in scalars}
        about = self.description
        whole = [s for s in (*about.scalars, *about.strings) if s.reference in references]
        whole.sort(key=lambda s: TYPES.index(s.type))
        place = {s.name: i for i, s in enumerate(whole)}
        into = np.array([place[s.name] for s in scalars], dtype=np.intp)
        known = {s.name: as_signal(s, value) for s, value in self.starts}
        everything = np.array([known.get(s.name, s.start) for s in whole])
        unconnected = set(place) if start else set(place) - {s.name for s in scalars}
        for name in unconnected - known.keys():
            if np.isnan(everything[place[name]]):
                what = f"{name} has no start value in an array of this size; give start.{name}"
                raise self._fault(what, 0.0)
        exact = {n: v for n, v in find_wide_integers(self.starts).items() if n in unconnected}
        return everything, into, self._transfers("Set", whole, everything, exact)

    def enter_initialization(self, start_time: float, stop_time: float) -> None:
        if any(s.structural for s, _ in self.starts):
            self._call("fmi3EnterConfigurationMode")
            self._set_starts(structural=True)
            self._call("fmi3ExitConfigurationMode")
        self._set_starts()
        self.place.time = start_time
        self._call("fmi3EnterInitializationMode", *self._tolerance, start_time, True, stop_time)
