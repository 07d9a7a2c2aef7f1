"""The event loop in C."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping

from hapticlink.orchestrator.plan.operations import Event, Part
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.run.compiled.events import Events
from hapticlink.orchestrator.run.compiled.machine import Machine
from hapticlink.orchestrator.run.python_loop import PythonLoop
from hapticlink.orchestrator.run.simulation import Simulation


class CompiledLoop(PythonLoop):
    """The same operations, in C where there is C for them."""

    def __init__(self, plan: Plan, simulation: Simulation, library: ctypes.CDLL) -> None:
        machine = Machine(library, simulation)
        super().__init__(plan, simulation, machine.in_python, machine.joined)
        self._machine = machine
        self._events = Events(machine, plan.system.timeline, self._block)

    def run(self, turn: Callable[[int], object]) -> None:
        """Run all events; `turn` is called from time to time, and at the end, with the tick."""
        watch = self._machine.library.watch
        try:
            watch(True)
            self._events.run(turn)
        finally:
            watch(False)
            self.complete = self._events.complete

    def _block(self, event: Event) -> tuple[int, int]:
        return self._machine.block(self._binder.instructions(self._plan.block(event)))

    def _times(self) -> Mapping[Event | Part, int]:
        return self._counts | self._events.counts()
