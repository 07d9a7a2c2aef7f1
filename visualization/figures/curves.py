"""Curves over a run: every sample of a short one; of a long one the minimum and the maximum of each
of STRETCHES intervals, which is what a screen can show."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.user_port import UserPort

LONG = 1 << 15
"""Samples above which a curve is long."""
STRETCHES = 2048
"""Of a long curve: more than a figure has pixels."""
Curve = tuple[NDArray[Any], ...]
"""Times or places, (k,), and what belongs to them, numbers or flags, each (k,) or (k, n)."""


def curve(*series: NDArray[Any]) -> Curve:
    """The samples of series that are drawn."""
    if len(series[0]) <= LONG:
        return series
    kept = extremes(series)
    return tuple(each[kept] for each in series)


def port_curve(port: UserPort) -> UserPort:
    """The energy at the user's port, as a curve."""
    names = [*port.blocks_J]
    time, hands, generated, *blocks = curve(*port[:3], *port.blocks_J.values())
    by_name = dict(zip(names, blocks, strict=True))
    return UserPort(time, hands, generated, by_name, port.works, port.hand_work_J)


def extremes(series: Sequence[NDArray[Any]], stretches: int = STRETCHES) -> list[int]:
    """The first and the last row, and the rows with the least and the most of each column in each
    stretch of rows, in order."""
    rows = np.linspace(0, len(series[0]), stretches + 1).astype(int)
    kept = {0, len(series[0]) - 1}
    for begin, end in pairwise(rows):
        for each in series if end > begin else ():
            part = each[begin:end]
            kept |= {*np.atleast_1d(begin + part.argmin(axis=0))}
            kept |= {*np.atleast_1d(begin + part.argmax(axis=0))}
    return sorted(int(row) for row in kept)
