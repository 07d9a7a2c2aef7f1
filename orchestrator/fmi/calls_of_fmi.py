"""The calls of an FMU that is loaded into this process, with its values in shared arrays: FMI 2.0
here, the differences of FMI 3.0 in `fmi3_differences`.

FMPy loads the library and instantiates; during the run the C functions are called directly, with
pointers that are created once. Every status is checked, every output must be finite, and the
messages that the FMU logged are part of the error.
"""

from __future__ import annotations

import ctypes
import logging
import math
import sys
import time as clock
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from fmpy import fmi2

from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.errors import AsksToEnd, FmuFault
from hapticlink.orchestrator.fmi import load_library, messages, process_cache
from hapticlink.orchestrator.fmi.directional_derivatives import derivatives
from hapticlink.orchestrator.fmi.instance import Instance, StepState
from hapticlink.orchestrator.fmi.load_library import load_slave
from hapticlink.orchestrator.fmi.saved_state import SavedFmuState
from hapticlink.orchestrator.fmi.setter import Setter, Setting
from hapticlink.orchestrator.fmi.status import (
    DISCARD,
    ERROR,
    FATAL,
    SHARE,
    STATUS,
    make_end_query,
    succeeded,
    worse,
)
from hapticlink.orchestrator.fmi.transfer import Transfer, Unfit, as_signal, transfers
from hapticlink.orchestrator.fmi.variables import TYPES, WRITTEN, Scalar
from hapticlink.orchestrator.host import host_state

if TYPE_CHECKING:  # a worker process need not load what reads scenes
    from hapticlink.orchestrator.fmi.start_values import Starts


class InProcess(Instance):
    """An FMU of FMI 2.0 whose library is loaded into this process. `slave` (of FMPy, None where it
    is not loaded), `gets` and `gets_between_rows` are for the compiled loop."""

    _library: Callable[..., Any] = fmi2.FMU2Slave

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.slave: Any = None
        self._status = 0
        self._saved: dict[int, SavedFmuState] = {}
        self._saved_time: dict[int, float] = {}
        self._initialized = self._over = self._is_new = False
        self._started: tuple[list[Scalar], Setting] | None = None
        self._some: dict[tuple[int, ...], tuple[Vector, list[Transfer]]] = {}
        self._setters = 0
        """Setters of an FMU of this project, whose inputs change by them alone; 0 of others."""
        self.holds_python = False
        self.texts = any(s.type in WRITTEN for s in self.description.scalars)
        self.in_c = not self.texts
        self._key = 0

    def _load(self) -> None:
        try:
            self._folder = process_cache.unpack(self.description, self._folder)
            idle = process_cache.take_instance(self._folder, self.name)
            self._key = messages.open_log(idle.key if idle else None)
            if self.log_path:
                messages.write_to(self._key, self.log_path, self.name, lambda: self.time)
            if idle:
                self.slave = idle.slave
            else:
                with host_state.restore_directory(self.name):
                    self.slave = self._instantiate()
            self._keep_arithmetic()
        except Exception as error:  # FMPy raises bare Exception
            reason = str(error)
            if reason.startswith("Failed to instantiate"):
                reason = "its instantiation failed"
                if not self._logged():  # which says why
                    reason += "; its guid may not be that of its binary"
            raise self._fault(f"could not be loaded: {reason}", 0.0) from error
        outputs = self.description.outputs
        self.gets = self.gets_between_rows = self._transfers("Get", outputs, self.outputs)
        if self.recorded_only and self.converted is None:
            often = [s for s in outputs if s.name not in self.recorded_only]
            places = [*map(outputs.index, often)]
            self.gets_between_rows = self._transfers("Get", often, self.outputs, {}, places)
        do_step = self._stepper()

        def advance(time: float, size: float) -> int:
            self.place.steps += 1
            try:
                status = do_step(time, size)
            except SystemError as error:
                raise self.raised(self.do_step, error) from error
            finally:
                self._keep_arithmetic()
            return self._judge_status(status, time)

        self._advance: Callable[[float, float], int] = advance

    def _instantiate(self) -> Any:
        about = self.description
        slave = load_slave(
            self._library, about.fmi, about.guid, about.identifier, self._folder, self.name
        )
        module = load_library.prepare(slave.dll, self._folder)
        self.holds_python = bool(module)
        slave.instantiate(loggingOn=True, **self._logging())
        if module and about.block is None:
            tell = partial(messages.keep_message, self._key, ERROR)
            load_library.tell_exceptions(module, self.name, tell)
        return slave

    def _logging(self) -> dict[str, Any]:
        """The arguments of FMPy's `instantiate` that bring messages here."""
        return {"callbacks": messages.callbacks(self._key)}

    def _stepper(self) -> Callable[[float, float], int]:
        """(time, size) -> status of a doStep."""
        do_step, component = self.slave.dll["fmi2DoStep"], self.slave.component
        do_step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
        self._ended = make_end_query(self.slave)
        forward = int(self.forward)
        return lambda time, size: do_step(component, time, size, forward)

    @property
    def do_step(self) -> str:
        """The name of its step function."""
        return f"fmi{self.description.fmi}DoStep"

    @property
    def forward(self) -> bool:
        """noSetFMUStatePriorToCurrentPoint: whoever can go back may be asked to."""
        return not (self.description.restores_state and self.goes_back)

    def _judge_status(self, status: int, time: float) -> int:
        """The status of a step from `time` (s) that returned `status`: ok where the FMU requests
        the end of the simulation by it."""
        if status == DISCARD and (end := self._ended(time)) is not None:
            self._end(end)
            return 0
        return status

    def _end(self, end: float) -> None:
        """The FMU requests the end of the simulation at `end` (s). Raises AsksToEnd if that lies
        within its step."""
        time, size = self.place.begin, self.place.size
        if not end >= time + (1 - SHARE) * size:  # or is no number
            what = f"asks to end the simulation at {end:.6g} s, within its step"
            raise AsksToEnd(self.name, what, time)
        self.place.ended = 1

    def _transfers(self, verb: str, *what: Any) -> list[Transfer]:
        return transfers(self.slave, self.description.fmi, verb, *what)

    # --- initialisation -------------------------------------------------------------------

    def connect(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Setter:
        order = sorted(range(len(scalars)), key=lambda i: TYPES.index(scalars[i].type))
        where, conversions = [places[i] for i in order], [scalars[i].conversion for i in order]
        setting = self._setting([scalars[i] for i in order])
        self._setters += self.description.block is not None
        set_all = partial(self._carry_out, counted="sets")
        return Setter(where, conversions, setting, set_all, self.place, self._setters)

    def _carry_out(self, transfers: Sequence[Transfer], counted: str) -> None:
        try:
            for transfer in transfers:
                setattr(self.place, counted, getattr(self.place, counted) + 1)
                status = transfer.call()
                self._keep_arithmetic()
                if not succeeded(status):
                    raise self.failed(transfer.name, status)
        except SystemError as error:
            raise self.raised(transfer.name, error) from error
        except Unfit as why:
            raise self._fault(str(why), self.time, repeatable=True) from None

    def _setting(self, scalars: Sequence[Scalar], start: bool = False) -> Setting:
        """`whole`, `into` and `transfers` of a Setter of `scalars`, sorted by type; start: with
        their start values, which no signal replaces."""
        known = {s.name: as_signal(s, value) for s, value in self.starts if start}
        values = np.array([known.get(s.name, 0.0) for s in scalars])
        return values, None, self._transfers("Set", scalars, values)

    def _set_starts(self, *, structural: bool = False) -> None:
        """Set the start values, of structural parameters or of all others."""
        chosen = [(s, value) for s, value in self.starts if s.structural == structural]
        chosen.sort(key=lambda start: TYPES.index(start[0].type))
        scalars = [s for s, _ in chosen]
        if self._started and self._started[0] == scalars:  # those of the run before
            values, _, transfers = self._started[1]
            values[:] = [as_signal(s, value) for s, value in chosen]
        else:
            setting = self._setting(scalars, start=True)
            self._started, transfers = (scalars, setting) if self.resets else None, setting[2]
        self._carry_out(transfers, "sets")

    def enter_initialization(self, start_time: float, stop_time: float) -> None:
        self.place.time = start_time
        self._call("fmi2SetupExperiment", *self._tolerance, start_time, True, stop_time)
        self._set_starts()
        self._call("fmi2EnterInitializationMode")

    @property
    def _tolerance(self) -> tuple[bool, float]:
        """Whether there is a tolerance for its solver, and which."""
        tolerance = self.description.tolerance
        return tolerance is not None, tolerance or 0.0

    def exit_initialization(self) -> None:
        self._call(f"fmi{self.description.fmi}ExitInitializationMode")
        self._initialized = True
        self.read()
        self._start_loop()

    def _call(self, name: str, *arguments: Any) -> None:
        try:
            getattr(self.slave, name)(self.slave.component, *arguments)
        except Exception as error:
            raise self.failed(name, getattr(error, "status", ERROR)) from error
        finally:
            self._keep_arithmetic()

    def _fmi(self, function: str, *arguments: Any) -> None:
        """Call a function that all versions of FMI have."""
        self._call(f"fmi{self.description.fmi}{function}", *arguments)

    def update_discrete_states(self) -> tuple[bool, bool, float]:
        """In event mode: whether its discrete states need another update, whether it requests the
        end of the simulation, and the time (s) of its next time event, infinity without one."""
        info = fmi2.fmi2EventInfo()
        self._call("fmi2NewDiscreteStates", ctypes.byref(info))
        next_event = info.nextEventTime if info.nextEventTimeDefined else math.inf
        return bool(info.newDiscreteStatesNeeded), bool(info.terminateSimulation), next_event

    def _keep_arithmetic(self) -> None:
        """Restores how this process rounds numbers where an FMU of others has changed it."""
        if self.description.block is None and host_state.restore_rounding():
            self.place.altered += 1

    # --- the loop -------------------------------------------------------------------------

    @property
    def asked(self) -> list[Transfer]:
        """The calls that `read` makes."""
        return self.gets if self.row_due.value else self.gets_between_rows

    def read(self) -> None:
        self._carry_out(self.asked, "gets")
        self._convert()

    def read_some(self, places: Sequence[int]) -> None:
        if (key := tuple(places)) not in self._some:
            values = np.zeros(len(places))
            scalars = [self.description.outputs[i] for i in places]
            self._some[key] = values, self._transfers("Get", scalars, values)
        values, transfers = self._some[key]
        self._carry_out(transfers, "gets")
        self.outputs[list(places)] = values
        self._convert(list(places))

    def jacobian(self, outputs: Sequence[Scalar], inputs: Sequence[Scalar]) -> Matrix | None:
        found = derivatives(self.slave, self.description, outputs, inputs)
        factors = np.array([s.conversion.factor for s in outputs])
        return found if found is None else factors[:, None] * found

    def step(self, time: float, end: float, size: float) -> None:
        place = self.place
        place.time = place.begin = time
        place.size, place.end = size, end
        if place.ended:
            raise AsksToEnd(self.name, "has asked to end the simulation", time)
        begin = clock.perf_counter()
        status = self._advance(time, size)
        place.step_time += clock.perf_counter() - begin
        self.stepped(status)

    def stepped(self, status: int) -> None:
        """Ends a step that returned `status`."""
        if not succeeded(status):
            raise self.failed(self.do_step, status)
        self.place.time = self.place.end

    def after_step(self, status: int) -> None:
        """Ends a step whose doStep, called by the compiled loop, returned `status`."""
        self.stepped(self._judge_status(status, self.place.begin))

    # --- FMU states: in slots, and as bytes ---------------------------------------------------

    def save(self, slot: int = 0) -> None:
        if not succeeded(status := self.slot(slot).save()):
            raise self.failed(f"fmi{self.description.fmi}GetFMUstate", status)
        self._saved_time[slot] = self.time

    def slot(self, slot: int) -> SavedFmuState:
        """The storage of a slot, which may not have been saved to."""
        if slot not in self._saved:
            self._saved[slot] = SavedFmuState(self.slave, self.description.fmi, self.place)
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

    # --- ends -----------------------------------------------------------------------------

    def failed(self, call: str, status: int) -> FmuFault:
        self._status = worse(self._status, status)
        named = STATUS[status] if 0 <= status < len(STATUS) else f"status {status}"
        return self._fault(f"{call} returned {named}", self.time, repeatable=status == DISCARD)

    def raised(self, call: str, error: SystemError) -> FmuFault:
        """The fault of a Python FMU whose library went on after an exception, which ctypes finds
        when the call returns."""
        self._status = worse(self._status, ERROR)
        cause = error.__cause__ or error
        what = f"{call} left {type(cause).__name__} behind: {cause}"
        return self._fault(what, self.time)

    def abandon(self) -> None:
        self._status = FATAL

    @property
    def resets(self) -> bool:
        """Whether it can be reset for the next run: a native one of this project."""
        own = self.description.block is not None and self.description.fmi == "2"
        return own and not self.holds_python

    def terminate(self) -> FmuFault | None:
        """End the run, where it has begun and FMI allows it; the fault of an FMU that fails in
        this."""
        if self.slave is None or self._status >= ERROR or not self._initialized:
            return None
        self._initialized, self._over = False, True
        terminate = f"fmi{self.description.fmi}Terminate"
        status = self.slave.dll[terminate](ctypes.c_void_p(self.slave.component))
        return None if succeeded(status) else self.failed(terminate, status)

    def reset(self) -> bool:
        """Whether it stands as a new instance, behind `terminate`: one that `resets` does, all of
        whose calls have succeeded."""
        if self._over and self.resets and not self._status:
            self._over = False
            component = ctypes.c_void_p(self.slave.component)
            self._is_new = succeeded(self.slave.dll["fmi2Reset"](component))
        return self._is_new

    def begin_again(self, starts: Starts) -> None:
        """Stand as a new instance with these start values, behind `reset`."""
        self.starts, self._is_new, self._counted, self.held = starts, False, False, 0
        self.good = None
        self._waiting.clear()
        self._saved_time.clear()
        self.bounds.forget()
        new, size = StepState(), ctypes.sizeof(StepState)
        ctypes.memmove(ctypes.addressof(self.place), ctypes.addressof(new), size)
        self.row_due = ctypes.c_int64(1)
        messages.open_log(self._key)

    def _logged(self) -> list[str]:
        return messages.newest_messages(self._key)

    def close(self) -> FmuFault | None:
        """After fmi2Fatal the FMU is not called again."""
        fault = None
        try:
            if self.slave is not None and self._status < FATAL:
                for saved in self._saved.values():
                    saved.free()
                fault = self.terminate()
                idle = self.reset() and process_cache.keep_instance(
                    self._folder, self.name, self.slave, self._key
                )
                if self._status < FATAL and not idle:
                    self.slave.freeInstance()
            return fault
        finally:
            self.slave = None
            messages.close_log(self._key)
            self._keep_arithmetic()
            if self.place.altered:
                warning = "%s changed how this process rounds numbers, in %d calls; it is restored"
                logging.getLogger(__name__).warning(warning, self.name, self.place.altered)
            if self._folder and not process_cache.leave(self._folder):
                # pythonfmu puts resources/ on sys.path for good.
                sys.path[:] = [p for p in sys.path if not p.startswith(self._folder)]
