"""When the samples of a connection were known to its target."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from hapticlink.orchestrator.results.tables import Results, Vector
from hapticlink.orchestrator.system.latency import Link


def known_from(results: Results, connection: str, stamps: Vector, same_clock: bool) -> Vector:
    """The times (s) from which the samples stamped `stamps` were known; infinite for lost ones.

    The recorded latency, with its seed, gives those of all samples that the link counted as sent.
    Without a link, or where its counts are not those of `stamps` (rows that are left out, steps
    that are repeated), and in the order of Jacobi, the largest age on one clock is taken for that
    of each sample.
    """
    record = results.record
    latency, counted = record.latencies.get(connection), record.links.get(connection)
    if latency and counted and record.coupling != "jacobi":
        base = Fraction(record.base.split()[0])
        link = Link(latency, base)
        ticks = np.array([link.draw() for _ in range(counted.sent)])
        # The sample of t = 0 is known at once; that of a sampled block is sent again beside it.
        again = counted.sent - (len(stamps) - 1)
        if again in (0, 1) and np.count_nonzero(ticks < 0) == counted.lost:
            late = np.where(ticks < 0, np.inf, ticks * float(base))[again:]
            return stamps + np.concatenate([[0.0], late])
    age = record.delays.get(connection) if same_clock else None
    known: Vector = stamps + (age.max if age else 0.0)
    return known
