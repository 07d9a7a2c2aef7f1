"""What an instance of an FMI 3.0 co-simulation FMU does otherwise than one of FMI 2.0.

Event mode, early return and intermediate updates are not asked for, so a step is whole and its
inputs are constant (FMI 3.0 section 4.2.1)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from fmpy import fmi3

from hapticlink.orchestrator.fmi.in_process import WARNING, InProcess
from hapticlink.orchestrator.fmi.instance import Vector
from hapticlink.orchestrator.fmi.messages import keep
from hapticlink.orchestrator.fmi.python_exit import release_at_exit
from hapticlink.orchestrator.fmi.slave_module import require_slave_module
from hapticlink.orchestrator.fmi.variables import TYPES, Scalar


class InProcess3(InProcess):
    """An FMI 3.0 FMU."""

    def _instantiate(self) -> Any:
        slave = fmi3.FMU3Slave(
            guid=self.description.guid,
            modelIdentifier=self.description.identifier,
            unzipDirectory=self._folder,
            instanceName=self.name,
        )
        release_at_exit(slave.dll)
        require_slave_module(slave.dll, self._folder)

        def log(environment: int | None, status: int, category: bytes, message: bytes) -> None:
            keep(self._key, status, message)

        slave.instantiate(loggingOn=True, logMessage=log)
        return slave

    def _stepper(self) -> Callable[[float, float], int]:
        do_step, component = self._slave.dll["fmi3DoStep"], self._slave.component
        event, end, early = (ctypes.c_bool() for _ in range(3))
        told = [ctypes.byref(flag) for flag in (event, end, early)]
        reached = ctypes.c_double()
        last = ctypes.byref(reached)
        forward = ctypes.c_bool("canGetAndSetFMUState" not in self.description.flags)
        instance = ctypes.c_void_p(component)

        def advance(time: float, size: float) -> int:
            at, over = ctypes.c_double(time), ctypes.c_double(size)
            status: int = do_step(instance, at, over, forward, *told, last)
            if end and status <= WARNING:
                self._end(reached.value)
            return status

        return advance

    def _setting(
        self, scalars: Sequence[Scalar]
    ) -> tuple[Vector, list[tuple[Callable[[], int], str]]]:
        """Arrays are set whole: entries that nobody sets keep their start values."""
        references = {s.reference for s in scalars}
        whole = [s for s in self.description.scalars if s.reference in references]
        whole.sort(key=lambda s: TYPES.index(s.type))
        place = {s.name: i for i, s in enumerate(whole)}
        into = np.array([place[s.name] for s in scalars], dtype=np.intp)
        known = {s.name: float(v) for s, v in self.starts if not isinstance(v, str)}
        everything = np.array([known.get(s.name, s.start) for s in whole])
        values = np.zeros(len(scalars))
        calls = [(t.call, t.name) for t in self._transfers("Set", whole, everything)]

        def spread() -> int:
            everything[into] = values
            return 0

        return values, [(spread, "set"), *calls]

    def _set_text(self, reference: int, text: str) -> None:
        one = (ctypes.c_uint * 1)(reference), 1, (ctypes.c_char_p * 1)(text.encode()), 1
        self._call("fmi3SetString", *one)

    def enter_initialization(self, stop_time: float) -> None:
        self._set_starts()
        self._call("fmi3EnterInitializationMode", False, 0.0, 0.0, True, stop_time)
