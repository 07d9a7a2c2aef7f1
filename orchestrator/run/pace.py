"""The wall clock of a run in real time: its schedule, and what became of it.

The event of tick k is due at origin + t_k/s, with s the speed, 1 in real time. Of the events of the
haptic clock, lateness is the time from there to the event's beginning, step time that from its
beginning to its completion; a deadline is missed where it is complete after the next one is due.
Events that are late are caught up with; with hardware in the loop, ticks that are past are skipped
instead. Where an event begins more than MOST after it was due, as after the machine was suspended,
the schedule moves.
"""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.run import real_time_priority
from hapticlink.orchestrator.run.compiled import structures

MOST = 100_000_000
"""ns by which an event may be late before the schedule moves."""
BINS, EXACT = 2304, 64
"""Bins of a histogram; those below EXACT ns are of 1 ns, above there are 64 to each power of 2."""
SWITCH = 5e-4
"""Time (s) for which another Python thread may keep the interpreter from the loop."""
_CLOCK, _WAIT = ctypes.CFUNCTYPE(ctypes.c_int64), ctypes.CFUNCTYPE(None, ctypes.c_int64)


class Pace:
    """Schedule and statistics of a run; the compiled loop works on `c`. speed: simulated seconds in
    one of the clock.

    clock: time (ns) of a clock that is never set back; wait: waits until a time of that clock, or
    shorter. Without them `take` gets those of the machine.
    """

    def __init__(
        self,
        clock: Callable[[], int] | None = None,
        wait: Callable[[int], object] | None = None,
        speed: float = 1.0,
    ) -> None:
        self._given = clock and wait and (clock, wait)
        self.priority: dict[str, str] = {}
        self.lateness, self.steps = np.zeros(BINS, np.int64), np.zeros(BINS, np.int64)
        self.c = structures.Pace(most=MOST, speed=speed)
        self.c.fill(self, "lateness", "steps")

    def take(self, library: ctypes.CDLL) -> None:
        """Take the clock, and give it to the compiled loop, whose own it is by default."""
        self.clock: Callable[[], int]
        self.wait: Callable[[int], object]
        own = library.now, library.wait
        self.clock, self.wait = self._given or own
        clock, wait = (_CLOCK(self.clock), _WAIT(self.wait)) if self._given else own
        self.c.fill(clock=clock, wait=wait)

    @property
    def speed(self) -> float:
        return float(self.c.speed)

    def change_speed(self, speed: float, time: float) -> None:
        """Go on at another speed from a simulated time (s) on, which stays due when it is."""
        self.c.origin += round(1e9 * time * (1 / self.c.speed - 1 / speed))
        self.c.speed = speed

    def skip_late(self, most: float) -> None:
        """Let haptic ticks that are past be skipped, and the schedule move where an event is more
        than `most` (s) late."""
        self.c.skips, self.c.most = 1, round(1e9 * most)

    def now(self) -> int:
        return self.clock()

    @contextmanager
    def undisturbed(self) -> Iterator[None]:
        """Start now; within the context no collection of garbage looks through what there is
        already, other threads of Python hand over soon, and this one has real-time priority as far
        as the user may."""
        before = sys.getswitchinterval()
        gc.freeze()
        sys.setswitchinterval(SWITCH)
        try:
            with real_time_priority.raise_priority() as self.priority:
                self.c.origin = self.clock()
                yield
        finally:
            sys.setswitchinterval(before)
            gc.unfreeze()

    def report(self) -> dict[str, Any]:
        c = self.c
        return {
            "reproducible": False,
            "speed": self.speed,
            "priority": self.priority,
            "ticks": c.ticks,
            "deadlines_missed": c.missed,
            "skipped": c.skipped,
            "moved": c.moved * 1e-9,
            "step_time": quantiles(self.steps, c.longest),
            "lateness": quantiles(self.lateness, c.latest),
            "histograms": {"step_time": _counts(self.steps), "lateness": _counts(self.lateness)},
        }


def quantiles(bins: NDArray[np.int64], largest: int) -> dict[str, float]:
    """Quantiles (s) of a histogram, each the upper end of its bin, at most 1.6 % above it, and the
    largest value (ns) in s."""
    below = bins.cumsum()
    shares = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}
    values = {
        name: 1e-9 * min(_upper(int(np.searchsorted(below, share * below[-1]))), largest)
        for name, share in shares.items()
    }
    return values | {"max": 1e-9 * largest}


def _upper(i: int) -> int:
    """The upper end (ns) of a bin."""
    shift = max(i // EXACT - 1, 0)
    return ((i - EXACT * shift + 1) << shift) - 1


def _counts(bins: NDArray[np.int64]) -> list[tuple[float, int]]:
    """The upper end (s) and the count of each bin that is not empty."""
    return [(1e-9 * _upper(int(i)), int(bins[i])) for i in np.flatnonzero(bins)]
