"""An FMU in a process of its own, so that its crash or hang does not affect the run.

The worker process has an `Instance`; each call is a message to it and an answer. Inputs are sent
with the next call and outputs come back with a step, so a step is one message. Its answer is
awaited in `finish`, so that several FMUs step concurrently (`run.instructions`).
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from hapticlink.orchestrator.base import interrupt, temporary_folders
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.errors import AsksToEnd, FmuFault
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.fmi.units import factors_and_offsets
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.fmi.worker_process import Died, Process

CLOSING = 10.0
"""Seconds that an FMU may take to terminate."""
LOADING = 60.0
"""Seconds at least that a process and its FMU may take to load, whatever the timeout of a call."""


class Caller(Protocol):
    """What carries out the calls of an FMU elsewhere, as `Process` does."""

    busy: bool
    interruptible: bool

    def send(self, message: Any, allowed: float) -> None: ...

    def answer(self, allowed: float | None = None) -> Any: ...

    def end(self) -> object: ...


class Isolated(Instance):
    """An FMU in a worker process: `step` starts a doStep, `finish` waits for it."""

    _process: Caller | None = None
    _fresh: bytes | FmuFault | None = None
    """Outputs that have come with a step and not been read, or why they could not be."""
    _dismissed = False
    _lost: FmuFault | None = None
    """How the process ended that was to close its FMU."""
    _calls: Mapping[str, int] = MappingProxyType({})
    """Known once the FMU is closed."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._pending: list[tuple[int, bytes]] = []
        self._saved_time: dict[int, float] = {}

    def _load(self) -> None:
        self._folder = temporary_folders.make_folder()
        self._process = Process("hapticlink.orchestrator.fmi.worker")
        self._process.interruptible = True
        what = (self.name, self.description, self.starts, self.policy)
        # The answer waits for `enter_initialization`: all FMUs of a run load at the same time.
        room = self._folder, self.log_path, self.goes_back
        self._send("load", *what, *room, allowed=max(self.policy.timeout, LOADING))

    # --- messages -------------------------------------------------------------------------

    def _send(self, call: str, *arguments: Any, allowed: float | None = None) -> None:
        assert self._process is not None
        if self._process.busy:
            self._await_unneeded_step()
        self._fresh = None
        try:
            self._process.send((self._pending, call, arguments), allowed or self.policy.timeout)
        except Died as how:
            raise self._died(how) from None
        self._pending = []

    def _answer(self) -> Any:
        """Wait for the worker's answer. Raises its FmuFault, or one that says how the process
        ended."""
        assert self._process is not None
        try:
            kind, answer = self._process.answer()
        except Died as how:
            raise self._died(how) from None
        if kind != "answer":
            raise {"fault": FmuFault, "end": AsksToEnd}[kind](self.name, *answer)
        return answer

    def _ask(self, call: str, *arguments: Any) -> Any:
        self._send(call, *arguments)
        return self._answer()

    def _await_unneeded_step(self) -> None:
        """Wait for a step whose result is not needed, because another FMU has failed at the same
        communication point. Raises FmuFault if the process has died."""
        try:
            self._answer()
        except FmuFault:
            if self._process is None:
                raise

    def _died(self, how: Died) -> FmuFault:
        self._process = None
        return FmuFault(self.name, f"its process {how}", self.time)

    @property
    def calls(self) -> dict[str, int]:
        """Counted by the worker, whose end loses them."""
        return dict(self._calls)

    # --- the calls of a run ---------------------------------------------------------------

    def connect(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Callable[[Vector], None]:
        """The function queues the values, converted, for the setter `key` of the worker."""
        key = self._ask("connect", [s.name for s in scalars])
        where = np.array(places, dtype=np.intp)
        converted = factors_and_offsets([s.conversion for s in scalars])

        def set_from(signals: Vector) -> None:
            if not self.ended:
                values = signals[where]
                if converted is not None:
                    values = values * converted[0] + converted[1]
                self._pending.append((key, values.tobytes()))

        return set_from

    def jacobian(self, outputs: Sequence[Scalar], inputs: Sequence[Scalar]) -> Matrix | None:
        matrix: Matrix | None = self._ask("jacobian", outputs, inputs)
        return matrix

    def enter_initialization(self, start_time: float, stop_time: float) -> None:
        self.place.time, process = start_time, self._process
        assert process is not None
        try:
            self._answer()  # of `_load`
            self._ask("enter_initialization", start_time, stop_time)
        except FmuFault:
            interrupt.raise_if_interrupted()  # by a signal
            raise
        process.interruptible = False

    def exit_initialization(self) -> None:
        self._ask("exit_initialization")
        self.read()
        self._start_loop()

    def read(self) -> None:
        if self._fresh is None or self._pending:
            self._fresh = self._ask("read")
        if isinstance(self._fresh, FmuFault):
            raise self._fresh
        self.outputs[:] = np.frombuffer(self._fresh)

    def read_some(self, places: Sequence[int]) -> None:
        self.outputs[list(places)] = np.frombuffer(self._ask("read_some", places))

    def step(self, time: float, end: float, size: float) -> None:
        if self.ended:
            raise AsksToEnd(self.name, "has asked to end the simulation", time)
        self.place.time, self._until = time, end
        self._send("step", time, end, size)

    def finish(self) -> None:
        place = self.place
        outputs, fault, place.ended, place.step_time = self._answer()
        self._fresh = outputs if fault is None else FmuFault(self.name, *fault)
        place.time = self._until

    def save(self, slot: int = 0) -> None:
        self._ask("save", slot)
        self._saved_time[slot] = self.time

    def rollback(self, slot: int = 0) -> None:
        self._pending = []  # inputs are part of the state
        self._ask("rollback", slot)
        self.place.time, self.place.ended = self._saved_time[slot], 0

    def serialized(self) -> bytes:
        state: bytes = self._ask("serialized")
        return state

    def deserialize(self, state: bytes) -> None:
        self._pending = []  # inputs are part of the state
        self._fresh = None  # and so are outputs
        self._ask("deserialize", state)

    def dismiss(self) -> None:
        """`close` waits for the worker; dismissing all first lets them close concurrently."""
        process = self._process
        if process is None or self._dismissed:
            return
        self._dismissed = True
        try:
            if process.busy:
                process.answer(CLOSING)
            process.send(([], "close", ()), CLOSING)
        except Died as how:
            self._lost = self._died(how)

    def abandon(self) -> None:
        if self._process is not None:
            self._process.end()

    def close(self) -> FmuFault | None:
        process = self._process
        try:
            self.dismiss()
            if process is not None and process.busy:
                self._calls = self._answer()
        except FmuFault as fault:
            self._lost = fault
        finally:
            self._process = None
            if process is not None:
                process.end()
            if self._folder:
                shutil.rmtree(self._folder, ignore_errors=True)
        return self._lost
