"""An instance of an FMI 2.0 co-simulation FMU whose values stand in shared arrays.

FMPy loads the library and instantiates; the calls of the loop go straight to the C functions,
on pointers made once. Every status is checked, every output must be finite, and whatever the
FMU logged goes into the error.
"""

from __future__ import annotations

import ctypes
import shutil
import sys
import tempfile
import time as clock
from collections.abc import Callable, Sequence
from itertools import count
from typing import Any

import numpy as np
from fmpy import extract, fmi2
from numpy.typing import NDArray

from hapticlink.orchestrator.description import TYPES, Description, Scalar
from hapticlink.orchestrator.faults import FmuFault
from hapticlink.orchestrator.transfer import transfers

Vector = NDArray[np.float64]
STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING, ERROR, FATAL = 1, 3, 4

_messages: dict[int, list[str]] = {}
_keys = count(1)


def _log(key: int | None, name: bytes, status: int, category: bytes, message: bytes) -> None:
    """Keep what an FMU says; it is shown when a call fails."""
    said = _messages.get(key or 0)
    if said is not None and status > 0:
        said.append(message.decode("utf-8", "replace").strip())


_CALLBACKS = fmi2.fmi2CallbackFunctions()
_CALLBACKS.logger = fmi2.fmi2CallbackLoggerTYPE(_log)
_CALLBACKS.allocateMemory = fmi2.defaultCallbacks.allocateMemory
_CALLBACKS.freeMemory = fmi2.defaultCallbacks.freeMemory


class Instance:
    """A loaded FMU, from instantiation to removal; a context manager.

    `outputs` is the view that `get` fills. After `connect`, `set` writes the values of
    `board` at the connected places.
    """

    def __init__(self, name: str, description: Description, outputs: Vector) -> None:
        self.name, self.description, self.outputs = name, description, outputs
        self.step_time = 0.0
        self._zeros = np.zeros(len(outputs))
        self._status = 0
        self._slave: Any = None
        self._key = next(_keys)
        self._folder = tempfile.mkdtemp(prefix="hapticlink-")

    def __enter__(self) -> Instance:
        try:
            self._load()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _load(self) -> None:
        _messages[self._key] = []
        try:
            extract(str(self.description.path), self._folder)
            slave = fmi2.FMU2Slave(
                guid=self.description.guid,
                modelIdentifier=self.description.identifier,
                unzipDirectory=self._folder,
                instanceName=self.name,
            )
            callbacks = fmi2.fmi2CallbackFunctions.from_buffer_copy(_CALLBACKS)
            callbacks.componentEnvironment = self._key
            slave.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception as error:  # FMPy raises bare Exception
            raise self._fault(f"could not be loaded: {error}", 0.0) from error
        self._slave = slave
        self._gets = transfers(slave, "Get", self.description.outputs, self.outputs)
        self._do_step = slave.dll["fmi2DoStep"]
        self._do_step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]

    # --- initialisation -------------------------------------------------------------------

    def connect(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Callable[[Vector], None]:
        """A function that takes the values at `places` of a board and sets `scalars` to them."""
        order = sorted(range(len(scalars)), key=lambda i: TYPES.index(scalars[i].type))
        values = np.zeros(len(scalars))
        where = np.array([places[i] for i in order], dtype=np.intp)
        setting = transfers(self._slave, "Set", [scalars[i] for i in order], values)

        def set_from(board: Vector) -> None:
            board.take(where, out=values, mode="clip")  # "raise" would copy through a buffer
            for transfer in setting:
                if (status := transfer.call()) > WARNING:
                    raise self._failed(transfer.name, status)

        return set_from

    def enter_initialization(self, stop_time: float) -> None:
        self._call("fmi2SetupExperiment", False, 0.0, 0.0, True, stop_time)
        self._call("fmi2EnterInitializationMode")

    def exit_initialization(self) -> None:
        self._call("fmi2ExitInitializationMode")

    def _call(self, name: str, *arguments: Any) -> None:
        try:
            getattr(self._slave, name)(self._slave.component, *arguments)
        except Exception as error:
            raise self._failed(name, getattr(error, "status", ERROR)) from error

    # --- the loop -------------------------------------------------------------------------

    time = 0.0
    """Where the instance stands (s), for messages."""

    def read(self) -> None:
        """All outputs, finite or not."""
        for transfer in self._gets:
            if (status := transfer.call()) > WARNING:
                raise self._failed(transfer.name, status)

    def get(self) -> None:
        """All outputs. Raises FmuFault naming the first that is not finite."""
        self.read()
        if self.outputs.dot(self._zeros) != 0.0:  # 0 x NaN and 0 x inf are NaN
            self.require_finite()

    def require_finite(self) -> None:
        for scalar, value in zip(self.description.outputs, self.outputs.tolist(), strict=True):
            if not np.isfinite(value):
                raise self._fault(f"output {scalar.name} is {value!r}", self.time)

    def step(self, time: float, end: float, size: float) -> None:
        """fmi2DoStep from `time` over `size`, to `end` (s)."""
        self.time = time
        begin = clock.perf_counter()
        status = self._do_step(self._slave.component, time, size, 1)
        self.step_time += clock.perf_counter() - begin
        if status > WARNING:
            raise self._failed("fmi2DoStep", status)
        self.time = end

    # --- ends -----------------------------------------------------------------------------

    def _failed(self, call: str, status: int) -> FmuFault:
        self._status = max(self._status, status)
        named = STATUS[status] if 0 <= status < len(STATUS) else f"status {status}"
        return self._fault(f"{call} returned {named}", self.time)

    def _fault(self, what: str, time: float) -> FmuFault:
        return FmuFault(self.name, what, time, _messages.get(self._key, [])[-5:])

    def close(self) -> None:
        """Terminate where FMI allows it, free, unload, remove the folder; in every state."""
        slave, self._slave = self._slave, None
        try:
            if slave is not None and self._status < FATAL:
                if self._status < ERROR:
                    slave.dll["fmi2Terminate"](ctypes.c_void_p(slave.component))
                slave.freeInstance()
        finally:
            _messages.pop(self._key, None)
            # pythonfmu puts resources/ on sys.path for good.
            sys.path[:] = [p for p in sys.path if not p.startswith(self._folder)]
            shutil.rmtree(self._folder, ignore_errors=True)
