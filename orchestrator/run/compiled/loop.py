"""The event loop in C."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

from hapticlink.orchestrator.plan.operations import Event
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.run.compiled.events import Events
from hapticlink.orchestrator.run.compiled.operation_records import Machine
from hapticlink.orchestrator.run.python_loop import PythonLoop
from hapticlink.orchestrator.run.simulation import Simulation


class CompiledLoop(PythonLoop):
    """The same operations, in C where there is C for them; alone in real time.

    events: the clocks and the kinds of events. change_hold: see Machine.
    """

    def __init__(self, plan: Plan, simulation: Simulation, library: ctypes.CDLL) -> None:
        self._machine = machine = Machine(library, simulation)
        super().__init__(plan, machine.operations, machine.in_python)
        timeline, pace = plan.system.timeline, simulation.pace
        self.change_hold = machine.change_hold
        self.events = Events(machine, timeline, self._block, pace, simulation.sides)

    def run(self, turn: Callable[[int], object]) -> None:
        """Run all events; `turn` is called from time to time, and at the end, with the tick."""
        watch = self._machine.library.watch
        try:
            watch(True)
            self.events.run(turn)
        finally:
            watch(False)
            self.complete = self.events.complete

    def _block(self, event: Event) -> tuple[int, int]:
        return self._machine.block(self._instructions(event))
