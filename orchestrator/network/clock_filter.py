"""Offset and drift of another computer's clock, from the exchanges of a run (RFC 5905).

An exchange is sent at t_1, received at t_2, answered at t_3 and arrives at t_4, t_2 and t_3 by the
other clock. With theta = ((t_2 - t_1) + (t_3 - t_4))/2 and delta = (t_4 - t_1) - (t_3 - t_2)
(RFC 5905 section 8), the other clock is ahead by theta within delta/2, however unequal the two
ways are. Of every 8 exchanges the one with the smallest delta is kept (the clock filter of section
10), so that what waited in queues does not count. A constant drift is assumed: it is the slope
between the best exchange of the first half of the time and that of the second half, and its
uncertainty is what both bounds allow.
"""

from __future__ import annotations

from typing import NamedTuple

STAGES = 8
"""Exchanges of which one is kept, as of NTP's clock filter."""
MAXFREQ = 500e-6
"""Drift (s/s) that no clock exceeds (RFC 5905 section 7.2)."""


class Exchange(NamedTuple):
    """theta and delta (ns) of an exchange that arrived at `time` (ns of the own clock)."""

    time: int
    theta: float
    delta: int


class ClockEstimate(NamedTuple):
    """By how much the other clock is ahead at `time` (s of the own clock) and how fast that grows
    (s/s), each with the most by which it can be wrong."""

    time: float
    offset: float
    offset_uncertainty: float
    drift: float
    drift_uncertainty: float

    def offset_at(self, time: float) -> float:
        """The offset (s) at a time of the own clock (s)."""
        return self.offset + self.drift * (time - self.time)


class ClockFilter:
    """Estimates another clock from exchanges, which are added in the order of their arrival."""

    def __init__(self) -> None:
        self._stage: list[Exchange] = []
        self._kept: list[Exchange] = []
        self.exchanges = 0

    def add(self, sent: int, received: int, answered: int, arrived: int) -> None:
        """Take the times t_1 to t_4 (ns) of an exchange."""
        theta = ((received - sent) + (answered - arrived)) / 2
        delta = (arrived - sent) - (answered - received)
        self._stage.append(Exchange(arrived, theta, delta))
        self.exchanges += 1
        if len(self._stage) == STAGES:
            self._kept.append(_best(self._stage))
            self._stage.clear()

    def estimate(self) -> ClockEstimate | None:
        """The estimate by all exchanges, None without one. As long as one alone is kept, the drift
        is 0 within MAXFREQ."""
        known = [*self._kept, *([_best(self._stage)] if self._stage else [])]
        if not known:
            return None
        best, middle = _best(known), (known[0].time + known[-1].time) / 2
        early = [e for e in known if e.time <= middle]
        late = [e for e in known if e.time > middle]
        drift, uncertain = 0.0, MAXFREQ
        if late:
            a, b = _best(early), _best(late)
            drift = (b.theta - a.theta) / (b.time - a.time)
            uncertain = (a.delta + b.delta) / 2 / (b.time - a.time)
        return ClockEstimate(
            1e-9 * best.time, 1e-9 * best.theta, 0.5e-9 * best.delta, drift, uncertain
        )


def _best(exchanges: list[Exchange]) -> Exchange:
    return min(exchanges, key=lambda exchange: exchange.delta)
