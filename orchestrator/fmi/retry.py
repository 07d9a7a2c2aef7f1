"""A step that an FMU discards, taken again in halves (FMI 2.0.5 section 4.2.2, FMI 3.0 section
4.2.1: fmi2Discard allows the master to try a smaller step from the state before)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

from hapticlink.orchestrator.fmi import python_libraries
from hapticlink.orchestrator.fmi.capabilities import STATE, VARIABLE_STEP
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.instance import Place
from hapticlink.orchestrator.fmi.status import DISCARD, succeeded

HALVINGS = 10


class Saved:
    """Storage for one FMU state. save and restore return the status of the call; `place` counts
    them, and forgets which inputs the FMU has. overwrites: pythonfmu forgets a state that is saved
    over (FMI 2.0.5 section 2.1.8 has it reused), so that it is freed before."""

    def __init__(self, slave: Any, fmi: str, place: Place) -> None:
        self._place = place
        state = "state" if fmi == "2" else "State"
        self._instance, self.state = ctypes.c_void_p(slave.component), ctypes.c_void_p()
        calls = (slave.dll[f"fmi{fmi}{verb}FMU{state}"] for verb in ("Get", "Set", "Free"))
        self.get, self.set, self.free_state = calls
        self.overwrites = python_libraries.is_python(slave.dll)

    def save(self) -> int:
        self._place.saves += 1
        if self.overwrites:
            self.free()
        return self.get(self._instance, ctypes.byref(self.state))

    def restore(self) -> int:
        self._place.rollbacks += 1
        self._place.setter = 0
        return self.set(self._instance, self.state)

    def free(self) -> None:
        if self.state:
            self.free_state(self._instance, ctypes.byref(self.state))
            self.state.value = None


class Retry:
    """Takes steps with the state before each saved. smaller: number of steps taken in halves.
    saved: the states by depth of halving."""

    def __init__(
        self, slave: Any, fmi: str, place: Place, advance: Callable[[float, float], int]
    ) -> None:
        self._advance, self.smaller = advance, 0
        self.saved = [Saved(slave, fmi, place) for _ in range(HALVINGS + 1)]

    @staticmethod
    def why_not(description: Description) -> str:
        """The reason why an FMU cannot repeat a step in smaller ones, "" if it can."""
        if description.timing == "sampled":
            return "not retried: a sampled block takes whole periods only"
        missing = [n for n in (VARIABLE_STEP, STATE[description.fmi]) if n not in description.flags]
        return f"not retried: the FMU lacks {' and '.join(missing)}" if missing else ""

    def step(self, time: float, size: float, depth: int = 0) -> int:
        """Status of a step from `time` over `size` (s), in up to 2^10 parts with the same
        inputs."""
        saved = self.saved[depth]
        if not succeeded(status := saved.save()):
            return status
        return self.after(self._advance(time, size), time, size, depth)

    def after(self, status: int, time: float, size: float, depth: int = 0) -> int:
        """Status of a step that returned `status`: taken again in halves if it was discarded."""
        if status != DISCARD or depth == HALVINGS:
            return status
        self.smaller += depth == 0
        if not succeeded(status := self.saved[depth].restore()):
            return status
        half = size / 2
        if not succeeded(status := self.step(time, half, depth + 1)):
            return status
        return self.step(time + half, half, depth + 1)

    def free(self) -> None:
        for saved in self.saved:
            saved.free()
