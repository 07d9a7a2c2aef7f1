"""The FMU states of an instance in this process: in slots, and as bytes."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from hapticlink.orchestrator.base.errors import FmuFault
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.fmi.retry import Saved
from hapticlink.orchestrator.fmi.status import ERROR, succeeded


class WithStates(Instance):
    """slave: of FMPy, None where it is not loaded."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.slave: Any = None
        self._status = 0
        self._saved: dict[int, Saved] = {}
        self._saved_time: dict[int, float] = {}

    @abstractmethod
    def failed(self, call: str, status: int, passing: bool = False) -> FmuFault:
        """The fault of a call that returned `status`."""

    def save(self, slot: int = 0) -> None:
        if not succeeded(status := self.slot(slot).save()):
            raise self.failed(f"fmi{self.description.fmi}GetFMUstate", status)
        self._saved_time[slot] = self.time

    def slot(self, slot: int) -> Saved:
        """The storage of a slot, which may not have been saved to."""
        if slot not in self._saved:
            self._saved[slot] = Saved(self.slave, self.description.fmi, self.place)
        return self._saved[slot]

    def rollback(self, slot: int = 0) -> None:
        if not succeeded(status := self._saved[slot].restore()):
            raise self.failed(f"fmi{self.description.fmi}SetFMUstate", status)
        self.place.time, self.place.ended = self._saved_time[slot], 0
        self._status = 0

    def serialized(self) -> bytes:
        state = self._state("Get", "getFMUState")
        try:
            content: bytes = self._state("Serialize", "serializeFMUState", state)
            return content
        finally:
            self.slave.freeFMUState(state)

    def deserialize(self, state: bytes) -> None:
        restored = self._state("DeSerialize", "deserializeFMUState", state)
        try:
            self._state("Set", "setFMUState", restored)
            self.place.setter = 0
        finally:
            self.slave.freeFMUState(restored)

    def _state(self, verb: str, method: str, *arguments: Any) -> Any:
        """The result of FMPy's `method`, which raises an exception for a status of error."""
        try:
            return getattr(self.slave, method)(*arguments)
        except Exception as error:
            call = f"fmi{self.description.fmi}{verb}FMUstate"
            raise self.failed(call, getattr(error, "status", ERROR)) from error

    def free_states(self) -> None:
        for saved in self._saved.values():
            saved.free()
