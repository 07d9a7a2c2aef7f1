"""The event loop in Python: binds operations to calls once, then loops over the events. It is the
reference of the compiled loop."""

from __future__ import annotations

from collections.abc import Callable

from hapticlink.orchestrator.plan.operations import Event
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_record import Iterations
from hapticlink.orchestrator.run.bind_operations import Binder, Bound
from hapticlink.orchestrator.run.fixed_point import total
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
        self._binder = Binder(simulation, joined)
        self._bound: dict[Event, list[Call]] = {}
        self.complete = 0

    def run(self, turn: Callable[[int], object]) -> None:
        """Run all events; `turn` is called after each with its tick."""
        for tick, event in self._plan:
            for call in self._calls(event):
                call(tick)
            self.complete += 1
            turn(tick)

    def _calls(self, kind: Event) -> list[Call]:
        """The calls of a kind of event, bound at its first occurrence."""
        if (calls := self._bound.get(kind)) is None:
            calls = self._bound[kind] = self._binder.bind_all(self._plan.block(kind))
        return calls

    def iterations(self) -> Iterations | None:
        return total(loop.counts for loop in self._binder.loops.values())
