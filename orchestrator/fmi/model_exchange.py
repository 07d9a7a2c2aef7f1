"""An FMU for model exchange: its equations, integrated here by CVODE from one communication point
to the next, so that a run has it as any other FMU.

FMI 2.0.5 chapter 3, FMI 3.0.2 chapter 3. Inputs are constant over a step. Where continuous ones
have changed, behind an event, and where a state was restored, CVODE begins without a history; else
it goes on. A step ends at a state event (a change of sign of an event indicator), at a step event
(of fmi2CompletedIntegratorStep, fmi3CompletedIntegratorStep) and at the time event that the FMU has
told; `event_mode` handles it there and goes on to the communication point. CVODE may step beyond a
communication point and interpolate, as in FMPy, but not beyond a time event. An FMU that is told of
completed steps is told of each, so that these end at communication points; FMPy tells of
communication points alone.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Collection
from functools import cached_property
from typing import Any

import numpy as np
from fmpy import fmi2, fmi3

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import FmuFault
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.fmi.cvode import Cvode, Unsolved
from hapticlink.orchestrator.fmi.description import TOLERANCE
from hapticlink.orchestrator.fmi.event_mode import MOST, WithEvents, is_continuous
from hapticlink.orchestrator.fmi.fmi3_differences import InProcess3
from hapticlink.orchestrator.fmi.setter import Setter
from hapticlink.orchestrator.fmi.status import DISCARD, SHARE, succeeded
from hapticlink.orchestrator.fmi.variables import TYPES, Scalar

LONGEST = 1 / 50
"""The longest step of CVODE, as a share of the run; FMPy's."""


class ModelExchange(WithEvents):
    """The equations of an FMU and their solver, before the class of its version of FMI."""

    _back = "EnterContinuousTimeMode"
    _derivatives_name = "GetDerivatives"

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        equations = self.description.equations
        assert equations is not None
        self.in_c, self._equations = False, equations
        self._solver: Cvode | None = None
        self._begins = True
        """Whether the solver begins anew."""
        self._newest: tuple[Setter, bytes] | None = None
        """The setter of continuous inputs that was called last, and its values."""
        self._of_fmu = 0.0
        """The time (s) that the FMU has been told."""
        self._failed: tuple[str, int] | None = None
        self._unfit = ""
        self._span = math.inf
        """Time (s) from its start to its stop."""
        self._counts = dict.fromkeys(("solver_steps", "evaluations", "events"), 0)

    @property
    def do_step(self) -> str:
        return "CVODE"

    @property
    def calls(self) -> dict[str, int]:
        """Besides, of the solver: its steps and evaluations of the derivatives; and how often there
        was event mode."""
        return super().calls | (self._counts if self._counted else {})

    def enter_initialization(self, start_time: float, stop_time: float) -> None:
        self._span = stop_time - start_time
        super().enter_initialization(start_time, stop_time)

    def exit_initialization(self) -> None:
        super().exit_initialization()
        self._solver = self._open_solver()

    # --- the equations ----------------------------------------------------------------------

    def _function(self, name: str) -> tuple[str, Callable[..., int], ctypes.c_void_p]:
        name = f"fmi{self.description.fmi}{name}"
        return name, getattr(self.slave.dll, name), ctypes.c_void_p(self.slave.component)

    def _open_solver(self) -> Cvode:
        """The solver, with one state that stays where the FMU has none, and has events still."""
        n, roots = self._size()
        self._x_size = n
        calls = [self._function(name) for name in (
            "SetTime", "SetContinuousStates", self._derivatives_name, "GetEventIndicators"
        )]  # fmt: skip
        (set_time, set_x, get_dx, get_z), fmu = (f for _, f, _ in calls), calls[0][2]
        names, counts = [name for name, *_ in calls], self._counts

        def told(time: float, x: Any) -> int:
            if not succeeded(status := set_time(fmu, time)):
                return self._refused(names[0], status)
            self._of_fmu = time
            if n and not succeeded(status := set_x(fmu, x, n)):
                return self._refused(names[1], status)
            return 0

        def derivatives(time: float, x: Any, dx: Any) -> int:
            counts["evaluations"] += 1
            if not n:
                dx[0] = 0.0
                return 0
            if status := told(time, x):
                return status
            if not succeeded(status := get_dx(fmu, dx, n)):
                return self._refused(names[2], status)
            return 0 if math.isfinite(sum(dx[:n])) else self._not_finite(dx)

        def indicators(time: float, x: Any, z: Any) -> int:
            if status := told(time, x):
                return status
            if not succeeded(status := get_z(fmu, z, roots)):
                return self._refused(names[3], status)
            return 0

        self._tell = told
        tolerance = self.description.tolerance or TOLERANCE
        longest = LONGEST * self._span
        return Cvode(max(n, 1), roots, derivatives, indicators, tolerance, longest)

    def _size(self) -> tuple[int, int]:
        """The number of its continuous states and of its event indicators."""
        return len(self._equations.states), self._equations.indicators

    def _refused(self, name: str, status: int) -> int:
        """What CVODE is told of a call that did not succeed: to try a shorter step where the FMU
        discards this one."""
        self._failed = name, status
        return 1 if status == DISCARD else -1

    def _not_finite(self, dx: Any) -> int:
        where = next((i for i in range(self._x_size) if not math.isfinite(dx[i])), None)
        if where is None:  # only their sum is too large
            return 0
        self._unfit = f"the derivative of {self._name_of(where)} is {dx[where]!r}"
        return 1

    def _name_of(self, index: int) -> str:
        names = self._equations.states
        return names[index] if index < len(names) else f"state {index + 1}"

    # --- a step -----------------------------------------------------------------------------

    def _stepper(self) -> Callable[[float, float], int]:
        self.step_flags = [ctypes.c_bool() for _ in range(3)]  # event, terminate, early
        self.reached = ctypes.c_double()
        return lambda time, size: self._in_parts(self._integrate, time, size)

    def _integrate(self, time: float, size: float) -> int:
        """Go on from `time` over `size` (s), or to the first event."""
        if self._begins:
            self._begin(max(time, self._of_fmu))
        until, completes, solver = time + size, self._equations.completes, self._solver
        assert solver is not None
        stop = until if completes else self.pending.next_event
        reached, event, ends, self._failed, self._unfit = time, False, False, None, ""
        while not (event or ends or reached >= min(until, stop)):
            try:
                reached, root = solver.advance(until, stop=stop, once=completes)
            except Unsolved as failure:
                raise self._unsolved(failure, time) from failure
            if status := self._tell(reached, solver.states):
                assert self._failed
                raise self.failed(*self._failed)
            event = root
            if completes:
                enter, ends = self._complete()
                event = event or enter
        for flag, value in zip(self.step_flags, (event, ends, reached < until), strict=True):
            flag.value = value
        self.reached.value = reached
        return status

    def _begin(self, time: float) -> None:
        """Have the solver begin at `time` (s) with the states that the FMU has."""
        assert self._solver is not None
        n, nominals = self._x_size, np.ones(max(self._x_size, 1))
        if n:
            self._fmi("GetContinuousStates", self._solver.states, n)
            self._fmi("GetNominalsOfContinuousStates", _pointer(nominals), n)
            nominals[~(nominals > 0)] = 1.0  # as FMI has it of unknown ones
        self._solver.begin(time, nominals)
        self._begins = False

    def _complete(self) -> tuple[bool, bool]:
        """Tell the FMU that a step of the solver is completed: whether it asks for event mode, and
        for the end of the simulation."""
        kind = ctypes.c_int if self.description.fmi == "2" else ctypes.c_bool
        enter, ends = kind(), kind()
        flags = ctypes.byref(enter), ctypes.byref(ends)
        self._fmi("CompletedIntegratorStep", kind(self.forward), *flags)
        return bool(enter), bool(ends)

    def _unsolved(self, failure: Unsolved, time: float) -> FmuFault:
        if self._failed and self._failed[1] != DISCARD:
            return self.failed(*self._failed)
        why = self._unfit
        if self._failed:
            why = f"{self._failed[0]} discards the states that it tries"
        elif not why and failure.worst is not None:
            why = f"the largest error is that of {self._name_of(failure.worst)}"
        what = f"CVODE cannot integrate it: {failure}{f' ({why})' if why else ''}"
        remedy = "another `tolerance` of its [[fmu]], or a higher rate, may help"
        return self._fault(f"{what}; {remedy}", time, repeatable=True)

    # --- what makes the solver begin anew ----------------------------------------------------

    def take_continuous(self, setter: Setter) -> None:
        """Where they have changed, an FMU with event indicators is in event mode at this instant: a
        relation that a jump has turned changes no sign afterwards."""
        newest = setter, setter.values.tobytes()
        if newest == self._newest:
            return
        self._begins, self._newest = True, newest
        if self._size()[1] and self.description.states is None:
            self.place.ended = self.event(self.time)

    def event(
        self,
        time: float,
        active: Collection[int] = (),
        settings: Callable[[], object] = lambda: None,
    ) -> bool:
        """A time event that rounding has put behind this instant, and one that lies before it, is
        one of it: an FMU that compares its time with that of the event finds it reached. So there
        are as many as an FMU that starts later than at 0 has behind it."""
        near, told = SHARE * self.place.size, time
        for _ in range(MOST):
            if (due := self.pending.next_event) <= time + near and due != told:
                told = self._set_time(due)
            self._begins = True
            self._counts["events"] += 1
            if self.description.states is not None and self._counted:
                raise self._fault(
                    "has an event where it is linearised, behind which nothing is", time
                )
            if super().event(time, active, settings):
                return True
            active, settings = (), lambda: None
            if self.pending.next_event > time:
                if told < time:
                    self._set_time(time)
                return False
        raise self._fault(f"its next event stays in the past after {MOST} of them", time)

    def _set_time(self, time: float) -> float:
        self._fmi("SetTime", time)
        self._of_fmu = time
        return time

    def rollback(self, slot: int = 0) -> None:
        super().rollback(slot)
        self._begins, self._of_fmu = True, self.time

    def serialized(self) -> bytes:
        """Where the description has a layout of it (`Description.states`), that of an FMU of this
        project: the values of all variables by reference, of which inputs and outputs alone are
        read, and then the continuous states."""
        if self.description.states is None:
            return super().serialized()
        ports = self._ports("input", "output")
        read = np.zeros(len(ports))
        self._carry_out(self._transfers("Get", ports, read), "gets")
        values, x = np.zeros(len(self._place)), np.zeros(self._x_size)
        values[[self._place[s.name] for s in ports]] = read
        if len(x):
            self._fmi("GetContinuousStates", _pointer(x), len(x))
        return np.concatenate([values, x]).tobytes()

    def deserialize(self, state: bytes) -> None:
        self._begins, self._newest, self._of_fmu = True, None, 0.0
        if self.description.states is None:
            super().deserialize(state)
            return
        values, x = np.split(np.frombuffer(state).copy(), [len(self._place)])
        if self._x_size:
            self._fmi("SetContinuousStates", _pointer(x), len(x))
        inputs = [s for s in self._ports("input") if is_continuous(s)]
        whole, into, sets = self._setting(inputs)
        whole[slice(None) if into is None else into] = values[[self._place[s.name] for s in inputs]]
        self._carry_out(sets, "sets")

    @cached_property
    def _place(self) -> dict[str, int]:
        """By name of a variable, its place by reference."""
        scalars = [s for s in self.description.scalars if s.causality != "independent"]
        return {s.name: i for i, s in enumerate(sorted(scalars, key=lambda s: s.reference))}

    def _ports(self, *causalities: str) -> list[Scalar]:
        """Variables by type, without clocks."""
        every = (s for s in self.description.scalars if s.type != "Clock")
        ports = [s for s in every if s.causality in causalities]
        return sorted(ports, key=lambda s: TYPES.index(s.type))

    def close(self) -> FmuFault | None:
        try:
            return super().close()
        finally:
            if self._solver:
                self._counts["solver_steps"] = self._solver.steps
                self._solver.close()
                self._solver = None


def _pointer(values: Vector) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


class ModelExchange2(ModelExchange):
    """An FMU of FMI 2.0 for model exchange."""

    _library = fmi2.FMU2Model


class ModelExchange3(ModelExchange, InProcess3):
    """An FMU of FMI 3.0 for model exchange."""

    _library = fmi3.FMU3Model
    _derivatives_name = "GetContinuousStateDerivatives"

    def _size(self) -> tuple[int, int]:
        """As the FMU tells, whose arrays structural parameters may have resized."""
        return self.slave.getNumberOfContinuousStates(), self.slave.getNumberOfEventIndicators()


MODEL_EXCHANGE: dict[str, type[InProcess]] = {"2": ModelExchange2, "3": ModelExchange3}
"""By version of FMI."""
