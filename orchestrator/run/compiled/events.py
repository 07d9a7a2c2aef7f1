"""Events of the compiled loop: the clocks' communication points, and the kinds of events."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.plan.operations import Event, Firing
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.machine import PATIENCE, Machine

WINDOW = 4096
"""Communication points of a clock that the loop gets at a time."""
NEVER = 2**62


class Events:
    """Runs all events of a timeline. block: adds the operations of a kind of event, and returns
    their indices."""

    def __init__(
        self, machine: Machine, timeline: Timeline, block: Callable[[Event], tuple[int, int]]
    ) -> None:
        self._machine, self._timeline, self._block = machine, timeline, block
        n = len(timeline.clocks)
        self._clocks = (structures.Clock * n)()
        self._given = [0] * n
        self._windows: list[object] = [None] * n
        self._key = np.zeros(1 + n, np.int64)
        self._kinds: list[Event] = []
        self._keys, self._blocks = np.zeros((0, 1 + n), np.int64), (structures.Block * 0)()
        self._c = c = structures.Events()
        c.clocks, c.n_clocks, c.end = ctypes.addressof(self._clocks), n, timeline.end
        c.key, c.patience, c.at.op = self._key.ctypes.data, PATIENCE, -1
        for i in range(n):
            self._next_window(i)

    @property
    def complete(self) -> int:
        """The number of events that are complete."""
        found: int = self._c.events
        return found

    def counts(self) -> dict[Event, int]:
        """How many events of each kind were begun."""
        return {event: b.count for event, b in zip(self._kinds, self._blocks, strict=True)}

    def run(self, turn: Callable[[int], object]) -> None:
        """Run all events; `turn` is called from time to time, and at the end, with the tick."""
        c, machine = self._c, self._machine
        loop, here = ctypes.addressof(machine.loop), ctypes.addressof(c)
        while code := machine.code(c.at, machine.library.events, loop, here):
            if code == structures.KIND:
                self._new_kind()
            elif code == structures.STARTS:
                self._next_window(c.at.what)
            elif code == structures.PAUSE:
                turn(c.tick)
            else:
                machine.serve(code, c.at, c.tick)
        turn(c.tick)

    def _next_window(self, i: int) -> None:
        """The next communication points of clock i: the current one comes first."""
        starts, clock = self._timeline.clocks[i].starts, self._clocks[i]
        first = self._given[i] + clock.at
        window = np.array(starts[first : first + WINDOW])
        if len(window) < 2:
            window = np.array([NEVER, NEVER])
        window = np.ascontiguousarray(window, np.int64)
        self._windows[i], self._given[i] = window, first
        clock.starts, clock.n, clock.at = window.ctypes.data, len(window), 0

    def _new_kind(self) -> None:
        key, clocks = self._key.tolist(), self._timeline.clocks
        fired = (
            Firing(clock.name, k // 2, bool(k % 2))
            for clock, k in zip(clocks, key[1:], strict=True)
            if k
        )
        event = Event(bool(key[0]), tuple(fired))
        first, last = self._block(event)
        self._kinds.append(event)
        self._keys = np.concatenate([self._keys, self._key[None]])
        blocks = (structures.Block * len(self._kinds))(*self._blocks)
        blocks[-1].first, blocks[-1].last = first, last
        self._blocks = blocks
        c = self._c
        c.keys, c.kinds = self._keys.ctypes.data, ctypes.addressof(blocks)
        c.n_kinds = len(self._kinds)
