"""Runs of one plan event by event side by side, lanes.c."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hapticlink.fmus.native.lane_library import step_of_lanes
from hapticlink.orchestrator.base.errors import Interrupted
from hapticlink.orchestrator.fmi.description import NEEDS_TOOL
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.library import load
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.system.system import System

_Lanes: Any = structures.Lanes
MOST = len(_Lanes().waiting)
"""Runs side by side."""


def find_steps(system: System, compiles: bool) -> dict[str, Any]:
    """By FMU, what takes a step of several instances at once, where there is that; none if an FMU
    holds Python, which counts on being alone. compiles: whether to compile those that the cache
    lacks."""
    if any(
        fmu.description.block is None or NEEDS_TOOL in fmu.description.flags for fmu in system.fmus
    ):
        return {}
    found = {f.name: step_of_lanes(f.description.path, compiles) for f in system.fmus}
    return {name: step for name, step in found.items() if step}


def run_side_by_side(
    loops: Sequence[CompiledLoop], steps: Mapping[str, Any], turn: Callable[[int], object]
) -> list[Exception | None]:
    """Run all events of loops of which each `goes_with` the others, with FMUs of which none holds
    Python; what ended a run before its last event. steps: of FMUs, what takes a step of all
    instances at once. `turn` is called from time to time with the tick. Raises Interrupted as it
    does."""
    library, lanes = load(), _Going(loops, steps)
    ended: list[Exception | None] = [None] * len(loops)
    try:
        library.watch(True)
        while lanes.loops and (code := library.lanes(ctypes.addressof(lanes.c))):
            loop = lanes.loops[lanes.c.lane]
            try:
                if code == structures.PAUSE:
                    turn(loop.events.c.tick)
                else:
                    loop.events.serve(code)
                    if code == structures.KIND:
                        lanes.find_steps()
            except Interrupted:
                raise
            except Exception as error:
                ended[loops.index(loop)] = error
                lanes.drop(lanes.c.lane)
    finally:
        library.watch(False)
        for loop in loops:
            loop.complete = loop.events.complete
    return ended


class _Going:
    """The loops that go on, and the structure for them."""

    def __init__(self, loops: Sequence[CompiledLoop], steps: Mapping[str, Any]) -> None:
        self.loops, self._steps, self.c = [*loops], steps, _Lanes()
        self._fill()

    def _fill(self) -> None:
        several = ctypes.c_void_p * max(len(self.loops), 1)
        self.c.fill(
            n=len(self.loops),
            loops=several(*(ctypes.addressof(loop.structure) for loop in self.loops)),
            events=several(*(ctypes.addressof(loop.events.c) for loop in self.loops)),
        )
        self.find_steps()

    def find_steps(self) -> None:
        """Take over the functions of the FMUs that operations refer to."""
        found = [self._steps.get(name) for name in (self.loops[0].fmus if self.loops else ())]
        addresses = [ctypes.cast(step, ctypes.c_void_p).value if step else None for step in found]
        self.c.fill(steps=(ctypes.c_void_p * max(len(addresses), 1))(*addresses))

    def drop(self, lane: int) -> None:
        """Leave out a run."""
        waiting = [*self.c.waiting]
        del self.loops[lane], waiting[lane]
        self.c.waiting[:] = [*waiting, 0]
        self._fill()
