"""Curves over a run: every sample of a short one; of a long one the minimum and the maximum of each
of STRETCHES intervals, which is what a screen can show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.user_port import UserPort, ports
from hapticlink.orchestrator.results.read_results import Results, Vector

STRETCHES = 2048
"""Of a long run: more than a figure has pixels."""
Curve = tuple[NDArray[Any], ...]
"""Times or places, (k,), and what belongs to them, numbers or flags, each (k,) or (k, n)."""


def curve(results: Results, of: Callable[[Results], Curve]) -> Curve:
    """What a function gives of each window, one after the other."""
    return _joined([_thinned(of(window), results.number) for window in results.windows()])


def port_curve(results: Results) -> UserPort | None:
    """The energy at the user's port, as a curve."""
    parts, last = list[Curve](), None
    for port in filter(None, ports(results)):
        parts.append(_thinned((*port[:3], *port.blocks_J.values()), results.number))
        last = port
    if last is None:
        return None
    time, hands, generated, *blocks = _joined(parts)
    by_name = dict(zip(last.blocks_J, blocks, strict=True))
    return UserPort(time, hands, generated, by_name, last.works, last.hand_work_J)


def _joined(parts: Sequence[Curve]) -> Curve:
    return tuple(np.concatenate(each) for each in zip(*parts, strict=True))


def _thinned(curve: Curve, windows: int) -> Curve:
    """The samples of a window that are drawn."""
    if windows == 1 or len(curve[0]) <= STRETCHES // windows:
        return curve
    kept = extremes(np.column_stack(curve), max(STRETCHES // windows, 1))
    return tuple(each[kept] for each in curve)


def extremes(columns: Vector, stretches: int) -> Sequence[int]:
    """The first and the last row, and the rows with the least and the most of each column in each
    stretch of rows, in order."""
    rows = np.linspace(0, len(columns), stretches + 1).astype(int)
    kept = {0, len(columns) - 1}
    for begin, end in pairwise(rows):
        if end > begin:
            part = columns[begin:end]
            kept |= {*(begin + part.argmin(axis=0)), *(begin + part.argmax(axis=0))}
    return sorted(kept)
