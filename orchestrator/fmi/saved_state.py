"""Storage for the state of an FMU that is loaded into this process."""

from __future__ import annotations

import ctypes
from typing import Any

from hapticlink.orchestrator.fmi import load_library
from hapticlink.orchestrator.fmi.instance import StepState


class SavedFmuState:
    """Storage for one FMU state. save and restore return the status of the call; `place` counts
    them, and forgets which inputs the FMU has. overwrites: pythonfmu forgets a state that is saved
    over (FMI 2.0.5 section 2.1.8 has it reused), so that it is freed before."""

    def __init__(self, slave: Any, fmi: str, place: StepState) -> None:
        self._place = place
        state = "state" if fmi == "2" else "State"
        self._instance, self.state = ctypes.c_void_p(slave.component), ctypes.c_void_p()
        calls = (slave.dll[f"fmi{fmi}{verb}FMU{state}"] for verb in ("Get", "Set", "Free"))
        self.get, self.set, self.free_state = calls
        self.overwrites = load_library.is_python(slave.dll)

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
