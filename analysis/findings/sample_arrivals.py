"""When the samples of a connection were known to its target."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from hapticlink.orchestrator.results.run_record import RunRecord
from hapticlink.orchestrator.results.tables import Vector
from hapticlink.orchestrator.system.latency_and_loss import Link


class Arrivals:
    """When the samples of a connection's source, the rows of a table, were known to its target.

    The recorded latency, with its seed, gives that of all samples that the link counted as sent.
    Without a link, or where its counts are not those of the samples (rows that are left out, steps
    that are repeated), and in the order of Jacobi, the largest age on one clock is taken for that
    of each sample.
    """

    def __init__(self, record: RunRecord, connection: str, samples: int, same_clock: bool) -> None:
        """same_clock: whether the rows are those of the FMU's clock."""
        self._late = _drawn(record, connection, samples)
        age = record.delays.get(connection) if same_clock else None
        self._age = age.max if age else 0.0

    def known(self, stamps: Vector, first: int) -> Vector:
        """The times (s) from which samples, the `first` and those that follow, stamped `stamps`
        were known; infinite for lost ones."""
        if self._late is None:
            return stamps + self._age
        return stamps + self._late[first : first + len(stamps)]


def _drawn(record: RunRecord, connection: str, samples: int) -> Vector | None:
    """The delay (s) of each sample, infinite where it was lost, as the link has drawn it."""
    latency, counted = record.latencies.get(connection), record.links.get(connection)
    if not latency or not counted or record.coupling == "jacobi":
        return None
    base = Fraction(record.base.split()[0])
    link = Link(latency, base)
    ticks = np.array([link.draw() for _ in range(counted.sent)])
    # The sample of t = 0 is known at once; that of a sampled block is sent again beside it.
    again = counted.sent - (samples - 1)
    if again not in (0, 1) or np.count_nonzero(ticks < 0) != counted.lost:
        return None
    late = np.where(ticks < 0, np.inf, ticks * float(base))[again:]
    return np.concatenate([[0.0], late])
