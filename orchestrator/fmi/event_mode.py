"""An FMU whose events its importer handles: here those of FMI 3.0 for co-simulation that declare it
(`hasEventMode`), in `model_exchange` those that a solver integrates.

FMI 3.0.2 section 4.2.1: "The importer must call fmi3EnterEventMode when any of the following
conditions are met: time has reached nextEventTime as returned by fmi3UpdateDiscreteStates, or the
FMU returned with eventHandlingNeeded = fmi3True from fmi3DoStep, or the importer plans discrete
changes to inputs, or an input Clock needs to be set." An FMU that takes steps of any size may
return early, at its event, and goes on to the end of the step from there: communication points are
those of the run. One of a fixed size has its events handled at the end of the step, "or if needed
slightly further" (section 2.3.5, nextEventTime).

Outputs at a communication point are those behind the events at the end of the step to it. A clock
that is due at a communication point is active at the beginning of the step from it, with the inputs
of that point, as a sampled controller takes them; one that is due within a step cuts it.
"""

from __future__ import annotations

import ctypes
import logging
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import AsksToEnd
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.fmi.clocks import APERIODIC, PERIODIC, FmiClock
from hapticlink.orchestrator.fmi.fmi3_differences import InProcess3
from hapticlink.orchestrator.fmi.setter import Setter
from hapticlink.orchestrator.fmi.status import SHARE, succeeded
from hapticlink.orchestrator.fmi.transfer import Transfer
from hapticlink.orchestrator.fmi.variables import CONTINUOUS, Scalar

MOST = 1000
"""Event iterations at one instant, and doSteps that do not advance time, before the FMU counts as
one that never settles."""
MOST_PARTS = 10_000
"""Parts of a step, each up to an event, before the FMU counts as one that chatters."""
CHANGED = 2
"""The value of fmi3IntervalQualifier for a new interval."""


@dataclass
class Pending:
    """What is not in the FMU's own state. next_event: the time (s) of its next time event.
    planned: those at which aperiodic clocks are due, by reference. values: the outputs, of which
    those with clocks, and the counts of these, keep their values where no clock is active. seen:
    the counts up to which triggered inputs have been activated, by reference."""

    values: Vector
    next_event: float = math.inf
    planned: dict[int, float] = field(default_factory=dict)
    seen: dict[int, float] = field(default_factory=dict)


class WithEvents(InProcess):
    """What FMUs with event mode have in common, before the class of their version of FMI. Their
    step function ends at an event, and tells by `step_flags` and `reached` as fmi3DoStep does."""

    _back = "EnterStepMode"
    """The function that leaves event mode."""
    step_flags: list[Any]
    reached: Any

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.in_c = False
        self.restored = 0
        """How often its state was restored."""
        self._cuts = self.description.varies_step
        self.pending = Pending(np.zeros(len(self.outputs)))
        self.inputs: EventSetter | None = None
        """The newest that was called."""
        self._clocks, self._start = self.description.clocks, Fraction(0)
        self._readings: dict[frozenset[int] | None, tuple[list[int], Vector, list[Transfer]]] = {}
        self._saved_pending: dict[int, Pending] = {}
        self.taken_over: Mapping[str, Any] | None = None
        """What the inputs' setter of an earlier run had set, until one of this run is called."""

    @property
    def has_events(self) -> bool:
        """Whether its events are handled here, by Python."""
        return not self.in_c

    @property
    def _returns_early(self) -> bool:
        return self.has_events and self._cuts

    # --- initialisation -------------------------------------------------------------------

    def exit_initialization(self) -> None:
        """Initialisation mode leads to event mode, whose iterations settle the outputs of t = 0."""
        if not self.has_events:
            super().exit_initialization()
            return
        self._start = Fraction(repr(self.time))
        self._clocks = tuple(self._with_interval(clock) for clock in self._clocks)
        self._plan(self.time, {c.reference for c in self._clocks if c.kind == "changing"})
        self._fmi("ExitInitializationMode")
        self._initialized = True
        ends = self._iterate()
        if not ends:
            self._fmi(self._back)
            ends = self.pending.next_event <= self.time and self.event(self.time)
        if ends:
            raise AsksToEnd(self.name, "has asked to end the simulation", self.time)
        self.read()
        self._start_loop()

    def connect(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Any:
        if self.has_events and self._initialized:
            return EventSetter(self, scalars, places)
        of = [i for i, s in enumerate(scalars) if s.type != "Clock"]
        return self.setter([scalars[i] for i in of], [places[i] for i in of])

    def setter(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Setter:
        """One that sets them in the mode in which it is called."""
        return super().connect(scalars, places)

    def _with_interval(self, clock: FmiClock) -> FmiClock:
        """A periodic clock with the interval that the FMU tells in initialisation mode."""
        if clock.kind not in PERIODIC or clock.interval is not None:
            return clock
        interval, _ = self._interval(clock)
        shift = ctypes.c_double()
        self._call("fmi3GetShiftDecimal", _one(clock.reference), 1, ctypes.byref(shift))
        if not interval > 0:
            raise self._fault(f"clock {clock.name} has an interval of {interval:g} s", self.time)
        return clock.timed(interval, shift.value)

    def _interval(self, clock: FmiClock) -> tuple[float, int]:
        """The interval (s) that the FMU tells of a clock, and its qualifier."""
        interval, qualifier = ctypes.c_double(), ctypes.c_int()
        results = ctypes.byref(interval), ctypes.byref(qualifier)
        self._call("fmi3GetIntervalDecimal", _one(clock.reference), 1, *results)
        return interval.value, qualifier.value

    # --- the loop -------------------------------------------------------------------------

    def _stepper(self) -> Callable[[float, float], int]:
        do_step = super()._stepper()
        return partial(self._in_parts, do_step) if self.has_events else do_step

    def _judge_status(self, status: int, time: float) -> int:
        return status if self.has_events else super()._judge_status(status, time)

    def _in_parts(self, do_step: Callable[[float, float], int], time: float, size: float) -> int:
        """The status of a step from `time` over `size` (s), in parts that end at events."""
        end, near, now = time + size, SHARE * size, time
        status, stuck, parts = 0, 0, 0
        if (due := self._due(time, near)) and self.event(time, due):
            self._end(time)
            return status
        while now < end - near:
            if (parts := parts + 1) > MOST_PARTS:
                what = f"it has {MOST_PARTS} events within one step: it switches on and off"
                raise self._fault(f"{what} all the time, which a hysteresis in it ends", now)
            until = self._until(now + near, end, near)
            status = do_step(now, size if (now, until) == (time, end) else until - now)
            if not succeeded(status):
                return status
            event, ends, early = (flag.value for flag in self.step_flags)
            reached = self.reached.value
            if ends:
                self._end(reached)
                return status
            if early and not self._returns_early:
                what = f"{self.do_step} returned early, at {reached:.6g} s, unasked"
                raise self._fault(what, time)
            stuck = stuck + 1 if early and reached <= now else 0
            if stuck > MOST:
                raise self._fault(f"{self.do_step} returned early {MOST} times in a row", now)
            now = min(max(reached, now), until) if early else until
            due = self._due(now, near) if now < end - near else frozenset()
            needed = event or due or now >= self.pending.next_event - near
            if needed and self.event(now, due):
                self._end(now)
                return status
        return status

    def _until(self, least: float, end: float, near: float) -> float:
        """The end of the part of a step to `end`: the next instant at which event mode is due, if
        that lies after `least` and within the step."""
        instants = {c.name: self._instant(c, least) for c in self._clocks}
        first = min(instants.values(), default=math.inf)
        if first < end - near and not self._cuts:
            name = next(name for name, instant in instants.items() if instant == first)
            what = f"clock {name} is due at {first:.6g} s, within a step, and the FMU takes steps"
            raise self._fault(f"{what} of one size only: give it the clock's rate", least)
        due = min(self.pending.next_event, first)
        return due if self._cuts and least < due < end - near else end

    def _due(self, time: float, near: float) -> frozenset[int]:
        """References of the clocks that are due at `time` (s)."""
        due = (c for c in self._clocks if self._instant(c, time - near) <= time + near)
        return frozenset(c.reference for c in due)

    def _instant(self, clock: FmiClock, least: float) -> float:
        """The first instant after `least` (s) at which a clock is due; infinity of one that is
        triggered, or has not told it."""
        if clock.kind in PERIODIC:
            return clock.first_after(least, self._start)
        return self.pending.planned.get(clock.reference, math.inf)

    def event(
        self,
        time: float,
        active: Collection[int] = (),
        settings: Callable[[], object] = lambda: None,
    ) -> bool:
        """Event mode at `time` (s), in which `settings` are made and the clocks of the references
        `active` are activated. Returns whether the FMU requests the end of the simulation."""
        self.place.time = time
        self._fmi("EnterEventMode")
        settings()
        for _ in range(MOST):
            if self._iterate(active):
                return True
            active = {r for r, at in self.pending.planned.items() if at <= time}
            if not active:
                self._fmi(self._back)
                return False
        raise self._fault(f"its clocks are due {MOST} times at one instant", time)

    def _iterate(self, active: Collection[int] = ()) -> bool:
        """Event iterations until the discrete states need no update. Returns whether the FMU
        requests the end of the simulation (FMI 3.0.2 section 2.3.5, fmi3UpdateDiscreteStates; FMI
        2.0.5 section 3.2.2, fmi2NewDiscreteStates)."""
        for _ in range(MOST):
            self._activate(active)
            more, ends, next_event = self.update_discrete_states()
            self._plan(self.time, active)
            active, self.pending.next_event = (), next_event
            if ends:
                return True
            if not more:
                return False
        raise self._fault(f"its discrete states need an update after {MOST} of them", self.time)

    # --- clocks ---------------------------------------------------------------------------

    def _activate(self, active: Collection[int]) -> None:
        """Activate input clocks, set the inputs with these clocks, and read the outputs with clocks
        that are active: "Clocked variables can acquire new values and can be queried only when
        their Clock is active" (FMI 3.0.2 section 2.2.9), which the next update ends."""
        if not self._clocks:
            return
        if active:
            references = (ctypes.c_uint * len(active))(*active)
            states = (ctypes.c_bool * len(active))(*[True] * len(active))
            self._call("fmi3SetClock", references, len(active), states)
            if self.inputs:
                self.inputs.set_clocked(frozenset(active))
        now = {*active}
        for i, output in enumerate(self.description.outputs):
            if output.type == "Clock":
                state = ctypes.c_bool()
                self._call("fmi3GetClock", _one(output.reference), 1, ctypes.byref(state))
                if state:
                    self.pending.values[i] += 1
                    now.add(output.reference)
        if now:
            self._read_those(frozenset(now))

    def _plan(self, time: float, active: Collection[int]) -> None:
        """Take what the FMU tells of the next instants of its aperiodic clocks: of one with a
        countdown in each event mode, of one whose interval changes where it was active."""
        for clock in self._clocks:
            if clock.kind in APERIODIC:
                if clock.reference in active:
                    self.pending.planned.pop(clock.reference, None)
                if clock.kind == "changing" and clock.reference not in active:
                    continue
                interval, qualifier = self._interval(clock)
                if qualifier == CHANGED:
                    self.pending.planned[clock.reference] = time + interval

    def _read_those(self, active: frozenset[int] | None) -> None:
        """Read the outputs that have one of the clocks `active`, or with None those that have no
        clock, into the vector of all outputs."""
        if active not in self._readings:
            places = [
                i
                for i, s in enumerate(self.description.outputs)
                if s.type != "Clock" and (not s.clocks if active is None else s.clocks & active)
            ]
            values, outputs = np.zeros(len(places)), [self.description.outputs[i] for i in places]
            self._readings[active] = places, values, self._transfers("Get", outputs, values)
        places, values, transfers = self._readings[active]
        self._carry_out(transfers, "gets")
        self.pending.values[places] = values

    def read(self) -> None:
        if not self._clocks:
            super().read()
            return
        if not self._initialized:  # where those with clocks may be read as well
            self._read_those(frozenset(c.reference for c in self._clocks))
        self._read_those(None)
        self.outputs[:] = self.pending.values
        self._convert()

    def read_some(self, places: Sequence[int]) -> None:
        if self._clocks:
            self.read()
        else:
            super().read_some(places)

    # --- states ---------------------------------------------------------------------------

    def save(self, slot: int = 0) -> None:
        super().save(slot)
        self._saved_pending[slot] = deepcopy(self.pending)

    def rollback(self, slot: int = 0) -> None:
        super().rollback(slot)
        self.pending = deepcopy(self._saved_pending[slot])
        self.restored += 1

    def saved_events(self) -> dict[str, Any]:
        """What of its events is not in the FMU's own state."""
        return vars(deepcopy(self.pending)) | {"inputs": self.inputs and self.inputs.saved()}

    def restore_events(self, saved: Mapping[str, Any]) -> None:
        """As `saved_events` had it, for the state that was deserialised. The setter of inputs that
        is called first takes on what the one before had set."""
        own = {name: saved[name] for name in vars(self.pending)}
        self.pending, self.taken_over = Pending(**own), saved["inputs"]

    def take_continuous(self, setter: Setter) -> None:
        """Continuous inputs have been set in step mode."""


class InProcessWithEvents(WithEvents, InProcess3):
    """An FMU of FMI 3.0 for co-simulation with event mode."""

    def _instantiate(self) -> Any:
        """One whose library refuses what its modelDescription.xml declares handles its events
        itself."""
        try:
            return super()._instantiate()
        except Exception:  # FMPy raises bare Exception, which comes again where this was not it
            if self._clocks or self.texts:
                raise
        self.in_c = True
        slave = super()._instantiate()
        warning = "%s declares event mode (hasEventMode) and refuses it: it handles its own events"
        logging.getLogger(__name__).warning(warning, self.name)
        return slave

    def _logging(self) -> dict[str, Any]:
        used = {"eventModeUsed": self.has_events, "earlyReturnAllowed": self._returns_early}
        return super()._logging() | used


class EventSetter:
    """Sets continuous inputs in step mode, and the others, which are discrete inputs and tunable
    parameters, in event mode when one of them has changed. Inputs with clocks wait until one of
    these is active. A triggered clock is active where the count that is connected to it has
    grown."""

    def __init__(
        self, instance: WithEvents, scalars: Sequence[Scalar], places: Sequence[int]
    ) -> None:
        self._instance, self._before = instance, (-1, b"")
        rows = [*zip(scalars, places, strict=True)]
        self._clocks = [(s.reference, p) for s, p in rows if s.type == "Clock"]
        self._clocked = [(s, p) for s, p in rows if s.clocks and s.type != "Clock"]
        others = [(s, p) for s, p in rows if not s.clocks and s.type != "Clock"]
        self._continuous = self._of([row for row in others if is_continuous(row[0])])
        self._discrete = self._of([row for row in others if not is_continuous(row[0])])
        self._signals: Vector = np.zeros(0)
        self._setters: dict[frozenset[int], Setter] = {}

    def _of(self, rows: Sequence[tuple[Scalar, int]]) -> Setter:
        return self._instance.setter([s for s, _ in rows], [p for _, p in rows])

    def __call__(self, signals: Vector) -> None:
        instance, discrete = self._instance, self._discrete
        if instance.ended:
            return
        instance.inputs = self
        if before := instance.taken_over:
            self._before, instance.taken_over = (instance.restored, before["discrete"]), None
        if self._clocked:
            self._signals = signals.copy()  # as they are now, when a clock is active
        self._continuous(signals)
        instance.take_continuous(self._continuous)
        seen, active = instance.pending.seen, []
        for reference, place in self._clocks:
            if signals[place] > seen.get(reference, 0.0):
                seen[reference] = float(signals[place])
                active.append(reference)
        now = instance.restored, signals[discrete.where].tobytes()
        changed = len(discrete.where) > 0 and now != self._before
        if changed or active:
            self._before = now
            settings = (lambda: discrete(signals)) if changed else (lambda: None)
            instance.place.ended = instance.event(instance.time, active, settings)

    def saved(self) -> dict[str, Any]:
        """The discrete inputs that it has set."""
        return {"discrete": self._before[1]}

    def set_clocked(self, active: frozenset[int]) -> None:
        """Set the inputs of clocks that are active."""
        if active not in self._setters:
            self._setters[active] = self._of(
                [row for row in self._clocked if row[0].clocks & active]
            )
        setter = self._setters[active]
        if len(setter.where):
            setter(self._signals)


def _one(reference: int) -> Any:
    return (ctypes.c_uint * 1)(reference)


def is_continuous(scalar: Scalar) -> bool:
    """Whether it may be set in step mode: an input that varies continuously, as those of floating
    point do by default (FMI 2.0.5 section 2.2.7, FMI 3.0.2 section 2.4.7.4)."""
    default = "continuous" if scalar.type in CONTINUOUS else "discrete"
    return scalar.causality == "input" and (scalar.variability or default) == "continuous"
