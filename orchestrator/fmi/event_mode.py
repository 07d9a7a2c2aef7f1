"""An FMI 3.0 co-simulation FMU whose events its importer handles (`hasEventMode`).

FMI 3.0.2 section 4.2.1: "The importer must call fmi3EnterEventMode when any of the following
conditions are met: time has reached nextEventTime as returned by fmi3UpdateDiscreteStates, or the
FMU returned with eventHandlingNeeded = fmi3True from fmi3DoStep, or the importer plans discrete
changes to inputs, or an input Clock needs to be set." An FMU that takes steps of any size may
return early, at its event, and goes on to the end of the step from there: communication points are
those of the run. One of a fixed size has its events handled at the end of the step, "or if needed
slightly further" (section 2.3.5, nextEventTime).

Outputs at a communication point are those behind the events at the end of the step to it.
"""

from __future__ import annotations

import ctypes
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import AsksToEnd
from hapticlink.orchestrator.fmi.capabilities import varies_step
from hapticlink.orchestrator.fmi.in_process_fmi3 import InProcess3
from hapticlink.orchestrator.fmi.setter import Setter
from hapticlink.orchestrator.fmi.status import DISCARD, succeeded
from hapticlink.orchestrator.fmi.termination import SHARE
from hapticlink.orchestrator.fmi.variables import Scalar

MOST = 1000
"""Event iterations at one instant, and doSteps that do not advance time, before the FMU counts as
one that never settles."""


@dataclass
class Pending:
    """What an FMU has announced. next_event: the time (s) of its next time event."""

    next_event: float = math.inf


class InProcessWithEvents(InProcess3):
    """An FMU of FMI 3.0 with event mode, whose library is loaded into this process."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.has_events = True
        self.restored = 0
        """How often its state was restored."""
        self._cuts = varies_step(self.description)
        self._pending = Pending()
        self._saved_pending: dict[int, Pending] = {}

    @property
    def in_c(self) -> bool:
        return not self.has_events

    def _instantiate(self) -> Any:
        """One whose library refuses what its modelDescription.xml declares handles its events
        itself."""
        with suppress(Exception):  # FMPy raises bare Exception; raised again below, where it stays
            return super()._instantiate()
        self.has_events = False
        slave = super()._instantiate()
        warning = "%s declares event mode (hasEventMode) and refuses it: it handles its own events"
        logging.getLogger(__name__).warning(warning, self.name)
        return slave

    def _logging(self) -> dict[str, Any]:
        used = {"eventModeUsed": self.has_events, "earlyReturnAllowed": self._returns_early}
        return super()._logging() | used

    @property
    def _returns_early(self) -> bool:
        return self.has_events and self._cuts

    # --- initialisation -------------------------------------------------------------------

    def exit_initialization(self) -> None:
        """Initialisation mode leads to event mode, whose iterations settle the outputs of t = 0."""
        if not self.has_events:
            return super().exit_initialization()
        self._call("fmi3ExitInitializationMode")
        self._initialized = True
        if self._iterate():
            raise AsksToEnd(self.name, "has asked to end the simulation", 0.0)
        self._call("fmi3EnterStepMode")
        self.read()
        self._start_loop()
        return None

    def connect(
        self,
        scalars: Sequence[Scalar],
        places: Sequence[int],
        exact: Mapping[str, int] = MappingProxyType({}),
    ) -> Any:
        if not (self.has_events and self._initialized):
            return super().connect(scalars, places, exact)
        discrete = [i for i, s in enumerate(scalars) if not _is_continuous(s)]
        groups = [i for i in range(len(scalars)) if i not in discrete], discrete
        setters = [
            super(InProcessWithEvents, self).connect(
                [scalars[i] for i in group], [places[i] for i in group], exact
            )
            for group in groups
        ]
        return EventSetter(self, *setters)

    # --- the loop -------------------------------------------------------------------------

    def _stepper(self) -> Callable[[float, float], int]:
        do_step = super()._stepper()
        return partial(self._in_parts, do_step) if self.has_events else do_step

    def _settled(self, status: int, time: float) -> int:
        return status if self.has_events else super()._settled(status, time)

    def _in_parts(self, do_step: Callable[[float, float], int], time: float, size: float) -> int:
        """The status of a step from `time` over `size` (s), in parts that end at events."""
        end, near, now = time + size, SHARE * size, time
        before, status, stuck = deepcopy(self._pending), 0, 0
        while now < end - near:
            until = self._until(now + near, end, near)
            status = do_step(now, size if (now, until) == (time, end) else until - now)
            if not succeeded(status):
                if status == DISCARD:
                    self._pending = before
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
            if (event or now >= self._pending.next_event - near) and self.event(now):
                self._end(now)
                return status
        return status

    def _until(self, least: float, end: float, near: float) -> float:
        """The end of the part of a step to `end`: the next time event, if it lies within."""
        due = self._pending.next_event
        return due if self._cuts and least < due < end - near else end

    def event(self, time: float, *settings: Callable[[], object]) -> bool:
        """Event mode at `time` (s), where `settings` are made. Returns whether the FMU requests the
        end of the simulation."""
        self.place.time = time
        self._call("fmi3EnterEventMode")
        for set_values in settings:
            set_values()
        if self._iterate():
            return True
        self._call("fmi3EnterStepMode")
        return False

    def _iterate(self) -> bool:
        """Event iterations until the discrete states need no update. Returns whether the FMU
        requests the end of the simulation (FMI 3.0.2 section 2.3.5, fmi3UpdateDiscreteStates)."""
        more, ends, _, _, defined = flags = [ctypes.c_bool() for _ in range(5)]
        next_event = ctypes.c_double()
        results = [*(ctypes.byref(flag) for flag in flags), ctypes.byref(next_event)]
        for _ in range(MOST):
            self._call("fmi3UpdateDiscreteStates", *results)
            self._pending.next_event = next_event.value if defined else math.inf
            if ends:
                return True
            if not more:
                return False
        raise self._fault(f"its discrete states need an update after {MOST} of them", self.time)

    # --- states ---------------------------------------------------------------------------

    def save(self, slot: int = 0) -> None:
        super().save(slot)
        self._saved_pending[slot] = deepcopy(self._pending)

    def rollback(self, slot: int = 0) -> None:
        super().rollback(slot)
        self._pending = deepcopy(self._saved_pending[slot])
        self.restored += 1


class EventSetter:
    """Sets continuous inputs in step mode, and the others, which are discrete inputs and tunable
    parameters, in event mode when one of them has changed."""

    def __init__(self, instance: InProcessWithEvents, continuous: Setter, discrete: Setter) -> None:
        self._instance, self._continuous, self._discrete = instance, continuous, discrete
        self._before: tuple[int, bytes] | None = None

    def __call__(self, signals: Vector) -> None:
        instance, discrete = self._instance, self._discrete
        if instance.ended:
            return
        self._continuous(signals)
        now = instance.restored, signals[discrete.where].tobytes()
        if len(discrete.where) and now != self._before:
            self._before = now
            instance.place.ended = instance.event(instance.time, lambda: discrete(signals))


def _is_continuous(scalar: Scalar) -> bool:
    """Whether it may be set in step mode: an input that varies continuously, as those of floating
    point do by default (FMI 3.0.2 section 2.4.7.4)."""
    default = "continuous" if scalar.type.startswith("Float") else "discrete"
    return scalar.causality == "input" and (scalar.variability or default) == "continuous"
