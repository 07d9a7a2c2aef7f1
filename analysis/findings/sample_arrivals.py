"""When the samples of a connection were known to its target."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from hapticlink.orchestrator.results.tables import Results, Vector
from hapticlink.orchestrator.scene.records import Latency
from hapticlink.orchestrator.system.latency import Link


def known_from(results: Results, connection: str, stamps: Vector, same_clock: bool) -> Vector:
    """The times (s) from which the samples stamped `stamps` were known; infinite for lost ones.

    Latencies and losses are drawn anew with the seed of the link. Without a link, or where its
    counts are not those of `stamps` (rows that are left out, steps that are repeated), and in the
    order of Jacobi, the largest age on one clock is taken for that of each sample.
    """
    run = results.run
    latency, counted = run["latencies"].get(connection), run["links"].get(connection)
    if latency and counted and run["coupling"] != "jacobi":
        base = Fraction(run["base"].split()[0])
        link = Link(Latency(**latency), base)
        drawn = np.array([link.draw() for _ in range(counted["sent"])])
        # The sample of t = 0 is known at once; that of a sampled block is sent again beside it.
        again = counted["sent"] - (len(stamps) - 1)
        if again in (0, 1) and np.count_nonzero(drawn < 0) == counted["lost"]:
            late = np.where(drawn < 0, np.inf, drawn * float(base))[again:]
            return stamps + np.concatenate([[0.0], late])
    age = run["delays"].get(connection, {}).get("max", 0.0) if same_clock else 0.0
    known: Vector = stamps + age
    return known
