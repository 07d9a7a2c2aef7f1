"""The events of a timeline and their kinds, all at once.

An event's key: whether it is the first, then for each clock twice the step (ticks) that it starts,
1 more where this is final, 0 where the clock does not fire.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.plan.operations import Event, Firing

Ticks = NDArray[np.int64]
KeyedEvents = tuple[Ticks, dict[Event, NDArray[np.intp]]]
"""Ticks of events, and the indices of those of each kind."""


def as_array(starts: Sequence[int]) -> Ticks:
    """Communication points; those of a range are not read one by one."""
    if isinstance(starts, range):
        return np.arange(starts.start, starts.stop, starts.step, dtype=np.int64)
    return np.array(starts, np.int64)


def keyed_events(timeline: Timeline, until: int, most: int) -> KeyedEvents:
    """The ticks of the events up to `until`, `most` of them, and the indices of those of each kind,
    which are in the order of their first occurrence."""
    every = [clock.starts for clock in timeline.clocks]
    until = min(until, *(starts[most] for starts in every if len(starts) > most), timeline.end)
    begun = [as_array(starts[: bisect_right(starts, until) + 1]) for starts in every]
    # With an index, since NumPy loads its masked arrays otherwise.
    ticks, _ = np.unique(np.concatenate([starts[:-1] for starts in begun]), return_index=True)
    ticks = ticks[ticks <= until]
    keys = np.zeros((len(ticks), 1 + len(begun)), np.int64)
    keys[:, 0] = ticks == 0
    for i, starts in enumerate(begun):
        start = starts[:-1][starts[:-1] <= until]
        after = starts[1 : len(start) + 1]
        keys[np.searchsorted(ticks, start), 1 + i] = 2 * (after - start) + (after > timeline.end)
    keys = keys[:most]
    order = np.lexsort(keys.T)
    kinds = np.split(order, np.flatnonzero(np.diff(keys[order], axis=0).any(axis=1)) + 1)
    kinds.sort(key=lambda rows: int(rows[0]))
    return ticks[:most], {event(timeline, keys[rows[0]].tobytes()): rows for rows in kinds}


def key_of(timeline: Timeline, kind: Event) -> list[int]:
    """The key of a kind of event."""
    fired = {f.clock: 2 * f.dticks + f.final for f in kind.firings}
    return [int(kind.first), *(fired.get(clock.name, 0) for clock in timeline.clocks)]


def event(timeline: Timeline, key: bytes) -> Event:
    """The kind of event with a key."""
    first, *steps = np.frombuffer(key, np.int64).tolist()
    fired = (
        Firing(clock.name, step // 2, bool(step % 2))
        for clock, step in zip(timeline.clocks, steps, strict=True)
        if step
    )
    return Event(bool(first), tuple(fired))
