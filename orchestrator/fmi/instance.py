"""An instance of a co-simulation FMU whose values stand in shared arrays: FMI 2.0 here, what
FMI 3.0 calls otherwise in `fmu3`.

FMPy loads the library and instantiates; the calls of the loop go straight to the C functions,
on pointers made once. Every status is checked, every output must be finite, and whatever the
FMU logged goes into the error.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import sys
import time as clock
from collections.abc import Callable, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
from fmpy import extract, fmi2
from numpy.typing import NDArray

from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.faults import AsksToEnd, Diverged, Fault, FmuFault
from hapticlink.orchestrator.fmi.bounds import Bounds
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.directional_derivatives import Matrix, derivatives
from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.fmi.input_derivatives import Varying
from hapticlink.orchestrator.fmi.python_exit import release_at_exit
from hapticlink.orchestrator.fmi.retry import Retry, Saved
from hapticlink.orchestrator.fmi.termination import SHARE, ended_in_discard
from hapticlink.orchestrator.fmi.transfer import Transfer, Unfit, transfers
from hapticlink.orchestrator.fmi.units import SAME
from hapticlink.orchestrator.fmi.variables import TYPES, Scalar

if TYPE_CHECKING:  # a worker process need not load what reads scenes
    from hapticlink.orchestrator.fmi.start_values import Starts

Vector = NDArray[np.float64]
STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4

_messages: dict[int, list[str]] = {}
_keys = count(1)


def _log(key: int | None, name: bytes, status: int, category: bytes, message: bytes) -> None:
    keep(key or 0, status, message)


def keep(key: int, status: int, message: bytes) -> None:
    """Keep what the FMU of instance `key` says; it is shown when a call fails."""
    said = _messages.get(key)
    if said is not None and status > 0:
        said.append((message or b"").decode("utf-8", "replace").strip())


_CALLBACKS = fmi2.fmi2CallbackFunctions()
_CALLBACKS.logger = fmi2.fmi2CallbackLoggerTYPE(_log)
_CALLBACKS.allocateMemory = fmi2.defaultCallbacks.allocateMemory
_CALLBACKS.freeMemory = fmi2.defaultCallbacks.freeMemory


class Instance:
    """A loaded FMU, from instantiation to removal; a context manager, which raises FmuFault where
    the FMU fails in its last call and nothing else has failed.

    `outputs` is the view that `get` fills. `connect` gives what writes the values of a board at
    the connected places. `held` counts the outputs that a policy has held at their last value.
    `ended`: the FMU has asked to end the simulation, so it is only read from then on.
    """

    ended = False

    def __init__(
        self,
        name: str,
        description: Description,
        outputs: Vector,
        starts: Starts = (),
        policy: Faults | None = None,
        folder: str | None = None,
    ) -> None:
        self.name, self.description, self.outputs = name, description, outputs
        self.starts, self.policy, self.held = starts, policy or Faults(), 0
        self._retry: Retry | None = None
        self._saved: dict[int, Saved] = {}
        self._saved_time: dict[int, float] = {}
        self._good: Vector | None = None
        self._initialized = False
        self.step_time = 0.0
        self._bounds = Bounds(description, outputs)
        self._status = 0
        self._slave: Any = None
        self._key = next(_keys)
        self._folder = folder or temporary_folders.new()

    def __enter__(self) -> Instance:
        try:
            self._load()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        fault = self.close()
        if fault and not isinstance(error, Fault | KeyboardInterrupt):
            raise fault

    def _load(self) -> None:
        _messages[self._key] = []
        before = os.getcwd()
        try:
            extract(str(self.description.path), self._folder)
            self._slave = self._instantiate()
        except Exception as error:  # FMPy raises bare Exception
            said = str(error)
            if said.startswith("Failed to instantiate"):
                said = "its instantiation failed; its guid may not be that of its binary"
            raise self._fault(f"could not be loaded: {said}", 0.0) from error
        finally:
            os.chdir(before)  # FMPy leaves it changed where a library cannot be loaded
        self._gets = self._transfers("Get", self.description.outputs, self.outputs)
        self._advance = self._stepper()
        if self.policy.discard == "retry" and Retry.possible(self.description):
            self._retry = Retry(self._slave, self.description.fmi, self._advance)
            self._advance = self._retry.step

    def _instantiate(self) -> Any:
        slave = fmi2.FMU2Slave(
            guid=self.description.guid,
            modelIdentifier=self.description.identifier,
            unzipDirectory=self._folder,
            instanceName=self.name,
        )
        release_at_exit(slave.dll)
        callbacks = fmi2.fmi2CallbackFunctions.from_buffer_copy(_CALLBACKS)
        callbacks.componentEnvironment = self._key
        slave.instantiate(callbacks=callbacks, loggingOn=True)
        return slave

    def _stepper(self) -> Callable[[float, float], int]:
        """(time, size) -> status of a doStep."""
        do_step, component = self._slave.dll["fmi2DoStep"], self._slave.component
        do_step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
        # noSetFMUStatePriorToCurrentPoint: whoever can go back may be asked to.
        forward = int("canGetAndSetFMUstate" not in self.description.flags)
        ended = ended_in_discard(self._slave)

        def advance(time: float, size: float) -> int:
            status: int = do_step(component, time, size, forward)
            if status == DISCARD and (end := ended(time)) is not None:
                self._end(end)
                return 0
            return status

        return advance

    def _end(self, end: float) -> None:
        """The FMU asks to end the simulation at `end` (s). Raises AsksToEnd where its step would
        have gone on."""
        time, size = self._stepping
        if end < time + (1 - SHARE) * size:
            what = f"asks to end the simulation at {end:.6g} s, within its step"
            raise AsksToEnd(self.name, what, time, passing=True)
        self.ended = True

    def _transfers(self, verb: str, scalars: Sequence[Scalar], values: Vector) -> list[Transfer]:
        return transfers(self._slave, self.description.fmi, verb, scalars, values)

    # --- initialisation -------------------------------------------------------------------

    def connect(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Callable[[Vector], None]:
        """A function that takes the values at `places` of a board and sets `scalars` to them."""
        order = sorted(range(len(scalars)), key=lambda i: TYPES.index(scalars[i].type))
        where = np.array([places[i] for i in order], dtype=np.intp)
        conversions = [scalars[i].conversion for i in order]
        plain = all(c == SAME for c in conversions)
        factors = np.array([c.factor for c in conversions])
        offsets = np.array([c.offset for c in conversions])
        values, setting = self._setting([scalars[i] for i in order])

        def set_from(board: Vector) -> None:
            if self.ended:
                return
            board.take(where, out=values, mode="clip")  # "raise" would copy through a buffer
            if not plain:
                values.__imul__(factors).__iadd__(offsets)
            try:
                for call, name in setting:
                    if (status := call()) > WARNING:
                        raise self._failed(name, status)
            except Unfit as why:
                raise self._fault(str(why), self.time, repeatable=True) from None

        return set_from

    def connect_derivatives(
        self, scalars: Sequence[Scalar], orders: Sequence[int], places: Sequence[int]
    ) -> Callable[[Vector], None]:
        """A function that sets what the scalars have at `places` of a board as their derivatives of
        an order; of order 0, their values, stand first and serve a step that is retried."""
        varying = Varying(self._slave, scalars, orders, places)
        if self._retry:
            self._retry.renew = varying.renew

        def set_from(board: Vector) -> None:
            if not self.ended and (status := varying.set(board)) > WARNING:
                raise self._failed(varying.name, status)

        return set_from

    def _setting(
        self, scalars: Sequence[Scalar]
    ) -> tuple[Vector, list[tuple[Callable[[], int], str]]]:
        """(values of `scalars`, the named calls that set them)."""
        values = np.zeros(len(scalars))
        return values, [(t.call, t.name) for t in self._transfers("Set", scalars, values)]

    def _set_starts(self) -> None:
        numbers = [(s, v) for s, v in self.starts if not isinstance(v, str)]
        if numbers:
            set_from = self.connect([s for s, _ in numbers], range(len(numbers)))
            set_from(np.array([float(v) for _, v in numbers]))
        for scalar, text in self.starts:
            if isinstance(text, str):
                self._set_text(scalar.reference, text)

    def _set_text(self, reference: int, text: str) -> None:
        one = (ctypes.c_uint * 1)(reference), 1, (ctypes.c_char_p * 1)(text.encode())
        self._call("fmi2SetString", *one)

    def enter_initialization(self, stop_time: float) -> None:
        self._call("fmi2SetupExperiment", False, 0.0, 0.0, True, stop_time)
        self._set_starts()
        self._call("fmi2EnterInitializationMode")

    def exit_initialization(self) -> None:
        self._call(f"fmi{self.description.fmi}ExitInitializationMode")
        self._start_loop()

    def _start_loop(self) -> None:
        self._initialized = True
        self._bounds.start()
        if self.policy.nan == "hold":
            self._good = self.outputs.copy()

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
        """All outputs. Raises FmuFault naming the first that is not finite, unless the policy is
        to keep its last value, and Diverged for the first that is beyond its bound."""
        self.read()
        if not self._bounds.kept():
            self._judge()
        if self._good is not None:
            self._good[:] = self.outputs

    def _judge(self) -> None:
        if self._good is None:
            self.require_finite()
        else:
            lost = ~np.isfinite(self.outputs)
            self.outputs[lost] = self._good[lost]
            self.held += int(lost.sum())
        if beyond := self._bounds.first_beyond():
            scalar, value, bound = beyond
            what = f"output {scalar.name} is {value:.3g}, beyond {bound:.3g}: the run has diverged"
            remedy = "take a higher rate, a finer integrator, or weaker gains"
            said = f"{what} ({remedy})"
            raise Diverged(self.name, said, self.time, passing=True, repeatable=True)

    @property
    def smaller_steps(self) -> int:
        """How many steps were discarded and taken again in smaller ones."""
        return self._retry.smaller if self._retry else 0

    def jacobian(self, outputs: Sequence[Scalar], inputs: Sequence[Scalar]) -> Matrix | None:
        """(outputs, inputs): the directional derivatives of what the FMU has computed last; None
        where it does not tell them."""
        return derivatives(self._slave, self.description, outputs, inputs)

    def require_finite(self) -> None:
        for scalar, value in zip(self.description.outputs, self.outputs.tolist(), strict=True):
            if not np.isfinite(value):
                what = f"output {scalar.name} is {value!r}"
                raise self._fault(what, self.time, passing=True, repeatable=True)

    def step(self, time: float, end: float, size: float) -> None:
        """fmi2DoStep from `time` over `size`, to `end` (s)."""
        self.time, self._stepping = time, (time, size)
        if self.ended:
            raise AsksToEnd(self.name, "has asked to end the simulation", time)
        begin = clock.perf_counter()
        status = self._advance(time, size)
        self.step_time += clock.perf_counter() - begin
        if status > WARNING:
            do_step = f"fmi{self.description.fmi}DoStep"
            raise self._failed(do_step, status, passing=status in (DISCARD, ERROR))
        self.time = end

    def save(self, slot: int = 0) -> None:
        """Keep the state in a slot (fmi2GetFMUstate); a slot keeps one."""
        if slot not in self._saved:
            self._saved[slot] = Saved(self._slave, self.description.fmi)
        if (status := self._saved[slot].save()) > WARNING:
            raise self._failed(f"fmi{self.description.fmi}GetFMUstate", status)
        self._saved_time[slot] = self.time

    def rollback(self, slot: int = 0) -> None:
        """Go back to the state in a slot, which keeps it (fmi2SetFMUstate)."""
        if (status := self._saved[slot].restore()) > WARNING:
            raise self._failed(f"fmi{self.description.fmi}SetFMUstate", status)
        self.time = self._saved_time[slot]
        self._status, self.ended = 0, False

    # --- ends -----------------------------------------------------------------------------

    def _failed(self, call: str, status: int, passing: bool = False) -> FmuFault:
        self._status = max(self._status, status)
        named = STATUS[status] if 0 <= status < len(STATUS) else f"status {status}"
        if status == DISCARD and self.policy.discard == "retry":
            why = "in steps of 1/1024 too" if self._retry else Retry.why_not(self.description)
            named += f" ({why})"
        what = f"{call} returned {named}"
        return self._fault(what, self.time, passing, repeatable=status == DISCARD)

    def _fault(
        self, what: str, time: float, passing: bool = False, repeatable: bool = False
    ) -> FmuFault:
        said = _messages.get(self._key, [])[-5:]
        return FmuFault(self.name, what, time, said, passing, repeatable)

    def close(self) -> FmuFault | None:
        """Terminate where FMI allows it, free, unload, remove the folder; in every state. The
        fault of an FMU that fails in that, which is not called again after a fatal one."""
        slave, self._slave = self._slave, None
        fault = None
        try:
            if slave is not None and self._status < FATAL:
                if self._retry is not None:
                    self._retry.free()
                for saved in self._saved.values():
                    saved.free()
                if self._status < ERROR and self._initialized:
                    terminate = f"fmi{self.description.fmi}Terminate"
                    status = slave.dll[terminate](ctypes.c_void_p(slave.component))
                    fault = self._failed(terminate, status) if status > WARNING else None
                if self._status < FATAL:
                    slave.freeInstance()
            return fault
        finally:
            _messages.pop(self._key, None)
            # pythonfmu puts resources/ on sys.path for good.
            sys.path[:] = [p for p in sys.path if not p.startswith(self._folder)]
            shutil.rmtree(self._folder, ignore_errors=True)
