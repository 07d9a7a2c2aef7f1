"""The event loop in Python: binds operations to calls once, then loops over the events. It is the
reference of the compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from hapticlink.orchestrator.holds import Hold
from hapticlink.orchestrator.plan.operations import Event, Part
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.record import Iterations, Steps
from hapticlink.orchestrator.run.bind_operations import Binder, Bound
from hapticlink.orchestrator.run.fixed_point import total
from hapticlink.orchestrator.run.paced_events import PacedEvents, Points
from hapticlink.orchestrator.run.simulation import Call, Simulation


class PythonLoop:
    """The loop of a plan. complete: number of events that are complete. in_python: what is carried
    out in Python, with the reason."""

    def __init__(
        self,
        plan: Plan,
        simulation: Simulation,
        in_python: dict[str, str],
        joined: Callable[[Bound], Call] | None = None,
    ) -> None:
        self._plan, self._simulation, self.in_python = plan, simulation, in_python
        self._binder = Binder(simulation, self._calls, joined)
        self._bound: dict[Event | Part, list[Call]] = {}
        self._paced = None
        if simulation.pace:
            self._paced = PacedEvents(plan.system.timeline, simulation.pace, simulation.sides)
        self.complete = 0

    def run(self, turn: Callable[[int], object]) -> None:
        """Run all events; `turn` is called after each with its tick, in real time every 20 ms."""
        for tick, event in self._paced.run(turn) if self._paced else self._plan:
            self._simulation.late = self._paced.late if self._paced else 0
            for call in self._calls(event):
                call(tick)
            self.complete += 1
            if not self._paced:
                turn(tick)

    def _calls(self, kind: Event | Part) -> list[Call]:
        """The calls of a kind of event, bound at its first occurrence."""
        if (found := self._bound.get(kind)) is None:
            found = self._bound[kind] = self._binder.bind_all(self._plan.block(kind))
        return found

    def prepare(self, kinds: Iterable[Event]) -> None:
        for kind in kinds:
            self._bound[kind] = self._binder.bind_all(self._plan.block(kind))

    # --- changes in real time ---------------------------------------------------------------

    @property
    def _points(self) -> Points:
        assert self._paced
        return self._paced

    def previous(self, clock: str) -> int:
        """The communication point (ticks) at which the newest sample of a clock is."""
        return self._points.point(clock, -1)

    def current(self, clock: str) -> int:
        """The communication point (ticks) that a clock goes to."""
        return self._points.point(clock)

    def patience(self, ns: int) -> None:
        self._points.patience(ns)

    def change_rate(self, clock: str, starts: Sequence[int]) -> None:
        """Replace the communication points of a clock, `previous` and `current` the first."""
        self._points.change(clock, starts)

    def change_hold(self, connection: str, hold: Hold) -> None:
        """Replace a hold. Raises InputFault where this loop cannot."""
        self._simulation.holds[connection] = hold
        self._bound.clear()

    def steps(self) -> dict[str, Steps]:
        return {clock: a.steps for clock, a in self._binder.advancers.items()}

    def iterations(self) -> Iterations | None:
        return total(loop.counts for loop in self._binder.loops.values())
