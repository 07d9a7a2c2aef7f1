"""The event loop in Python, which is the reference of the compiled loop."""

from __future__ import annotations

from collections.abc import Callable

from hapticlink.orchestrator.plan.operations import Event
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_record import Iterations
from hapticlink.orchestrator.run.fixed_point import total
from hapticlink.orchestrator.run.instructions import Instruction, instructions
from hapticlink.orchestrator.run.operations_in_python import OperationsInPython


class PythonLoop:
    """The loop of a plan. complete: number of events that are complete. in_python: what is carried
    out in Python, with the reason."""

    def __init__(
        self, plan: Plan, operations: OperationsInPython, in_python: dict[str, str]
    ) -> None:
        self._plan, self._operations, self.in_python = plan, operations, in_python
        self.complete = 0

    def run(self, turn: Callable[[int], object]) -> None:
        """Run all events; `turn` is called after each with its tick."""
        known: dict[Event, list[Instruction]] = {}
        for tick, event in self._plan:
            if event not in known:
                known[event] = self._instructions(event)
            for instruction in known[event]:
                self._operations(instruction, tick)
            self.complete += 1
            turn(tick)

    def _instructions(self, kind: Event) -> list[Instruction]:
        return [*instructions(self._plan.block(kind), self._operations.simulation)]

    def iterations(self) -> Iterations | None:
        return total(loop.counts for loop in self._operations.loops.values())
