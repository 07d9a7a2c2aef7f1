"""The events of a run in real time, for the loop in Python: each when it is due, and those of FMUs
beside the loop once their steps are done. It is the specification of `next_event` in loop.c."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Protocol

from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.plan.operations import Event, Firing
from hapticlink.orchestrator.plan.plan import Moment
from hapticlink.orchestrator.run.concurrent_fmus import Side
from hapticlink.orchestrator.run.pace import Pace

PATIENCE = 20_000_000
"""ns after which `turn` is called."""


class Points(Protocol):
    """The communication points of the clocks of a run in real time."""

    def point(self, clock: str, ahead: int = 0) -> int:
        """A communication point of a clock (ticks): the one that it goes to, or so many after."""

    def change(self, clock: str, starts: Sequence[int]) -> None:
        """Replace the communication points of a clock; it goes to the second one of `starts`."""

    def patience(self, ns: int) -> None:
        """Have `turn` called after that time each."""


class PacedEvents:
    """The events in the order in which they are carried out; `late` is by how many ticks the last
    one came after its own."""

    def __init__(self, timeline: Timeline, pace: Pace, sides: Mapping[str, Side]) -> None:
        self._timeline, self._pace = timeline, pace
        self._names = [clock.name for clock in timeline.clocks]
        self._sides = [sides.get(name) for name in self._names]
        self._starts = [clock.starts for clock in timeline.clocks]
        self._at = [0] * len(self._names)
        self._since, self._patience = pace.clock(), PATIENCE
        self.late = 0

    def point(self, clock: str, ahead: int = 0) -> int:
        i = self._names.index(clock)
        return self._starts[i][self._at[i] + ahead]

    def change(self, clock: str, starts: Sequence[int]) -> None:
        i = self._names.index(clock)
        self._starts[i], self._at[i] = starts, 1

    def patience(self, ns: int) -> None:
        self._patience = ns

    def run(self, turn: Callable[[int], object]) -> Iterator[Moment]:
        """All events; `turn` is called after 20 ms each, with the tick."""
        pace, seconds = self._pace, self._timeline.seconds
        for tick, after in self._events(turn):
            self.late = max(pace.c.reached - tick, 0)
            firings = (
                Firing(self._names[i], starts - self._start(i), starts > self._timeline.end)
                for i, at in after.items()
                for starts in (self._starts[i][at],)
            )
            event = Event(tick == 0, tuple(firings))
            if 0 in after:
                pace.begin(seconds(tick))
            yield Moment(tick, event)
            for i, at in after.items():
                self._at[i] = at
                if side := self._sides[i]:
                    side.c.awaited = 0
            if 0 in after:
                pace.end(seconds(event.firings[0].dticks))
            self._maybe(turn, tick)
        turn(self._timeline.end)

    def _start(self, i: int) -> int:
        return self._starts[i][self._at[i]]

    def _maybe(self, turn: Callable[[int], object], tick: int) -> None:
        if (time := self._pace.clock()) - self._since >= self._patience:
            self._since = time
            turn(tick)

    def _events(self, turn: Callable[[int], object]) -> Iterator[tuple[int, dict[int, int]]]:
        """(tick, for each clock that fires its place after the event)."""
        end = self._timeline.end
        while (tick := self._next()) is not None:
            self._wait(tick, turn)
            if found := self._late():
                yield found
                continue
            after = {}
            for i, side in enumerate(self._sides):
                if self._start(i) != tick or tick > end or (side and side.c.awaited):
                    continue
                if side and side.busy:
                    side.c.awaited = 1
                else:
                    after[i] = self._at[i] + 1
            if after:
                yield tick, after
            else:
                self._maybe(turn, tick)

    def _next(self) -> int | None:
        """The tick of the next event; past the end, that of the next haptic tick while steps are
        awaited, or None."""
        end, waits, ticks = self._timeline.end, False, []
        for i, side in enumerate(self._sides):
            if side and side.c.awaited:
                waits |= self._start(i) <= end
            else:
                ticks.append(self._start(i))
        if min(ticks) <= end:
            return min(ticks)
        reached: int = max(self._pace.c.reached, end)
        return reached + self._start(0) - end if waits else None

    def _wait(self, tick: int, turn: Callable[[int], object]) -> None:
        pace, until = self._pace, self._pace.due(self._timeline.seconds(tick))
        while (time := pace.clock()) < until:
            far = until - time > PATIENCE
            if far and time >= self._since + PATIENCE:
                self._since = time
                turn(tick)
                until = pace.due(self._timeline.seconds(tick))
                continue
            pace.wait(min(until, self._since + PATIENCE) if far else until)
        pace.c.reached = max(pace.c.reached, tick)

    def _late(self) -> tuple[int, dict[int, int]] | None:
        """The event of an awaited step that is done."""
        for i, side in enumerate(self._sides):
            if not side or not side.c.awaited or side.busy or self._start(i) > self._timeline.end:
                continue
            starts, after = self._starts[i], self._at[i] + 1
            if side.c.longer:
                while starts[after] <= self._pace.c.reached and after + 1 < len(starts):
                    after += 1
            return self._start(i), {i: after}
        return None
