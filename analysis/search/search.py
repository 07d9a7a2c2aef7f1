"""How settings are searched: the largest value that holds, laws raised one after the other, the
least cost by steps of one coordinate, and candidates judged best first."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from hapticlink.analysis.search.settings import Scales
from hapticlink.orchestrator.base.errors import InputFault

DOUBLINGS = 10
"""How often a scale is doubled or halved on the way to a limit."""
COARSE, FINE = 0.05, 0.01
"""Of the logarithm of a scale, how well the largest is found."""
Candidate = TypeVar("Candidate")
Judged = TypeVar("Judged")
Number = TypeVar("Number", int, float)
Point = tuple[int, ...]
Cost = tuple[float, ...]


@dataclass(frozen=True)
class Largest:
    """The largest value that holds, 0 where none does. limited: whether a larger one was tried,
    which does not; otherwise the search ended there."""

    value: float
    limited: bool = True


def largest_scale(holds: Callable[[float], bool], fine: float) -> Largest:
    """The largest scale that holds, on the way from 1, to `fine` of its logarithm."""

    def between(low: float, high: float) -> float | None:
        return math.sqrt(low * high) if math.log(high / low) > fine else None

    def half(scale: float) -> float:
        return scale / 2 if scale > 2.0**-DOUBLINGS else 0.0

    return _largest(holds, 1.0, 2.0**DOUBLINGS, half, between)


def largest_count(holds: Callable[[int], bool], first: int, most: int) -> Largest:
    """The largest count up to `most` that holds, on the way from the `first`: where it is limited
    the next count does not hold."""

    def between(low: int, high: int) -> int | None:
        return (low + high) // 2 if high - low > 1 else None

    return _largest(holds, first, most, lambda n: n // 2, between)


def _largest(
    holds: Callable[[Number], bool],
    first: Number,
    most: Number,
    half: Callable[[Number], Number],
    between: Callable[[Number, Number], Number | None],
) -> Largest:
    """By doubling or halving, and bisection from there."""
    low = high = first
    if holds(first):
        while low < most and holds(high := min(2 * low, most)):
            low = high
        if low >= most:
            return Largest(low, limited=False)
    else:
        while (low := half(high)) and not holds(low):
            high = low
        if not low:
            return Largest(0.0)
    while (middle := between(low, high)) is not None:
        low, high = (middle, high) if holds(middle) else (low, middle)
    return Largest(low)


def raise_laws(
    laws: Sequence[str],
    scales: Scales,
    require: Callable[[Scales], None],
    complete: Callable[[Scales], Scales] | None = None,
) -> tuple[Scales, str]:
    """The largest scales that hold, one law after the other from given ones on, and why larger ones
    do not. `complete` sets further laws to those that are tried. `require` raises InputFault with
    the reason, and so does this where none hold."""
    why = []
    for law in laws:
        scales, limit = _raised(law, scales, require, complete)
        why.append(f"{limit} ({law})")
    return scales, "; ".join(why)


def _raised(
    law: str,
    scales: Scales,
    require: Callable[[Scales], None],
    complete: Callable[[Scales], Scales] | None,
) -> tuple[Scales, str]:
    why = ""

    def at(times: float) -> Scales:
        raised = {**scales, law: times * scales[law]}
        return complete(raised) if complete else raised

    def holds(times: float) -> bool:
        nonlocal why
        try:
            require(at(times))
        except InputFault as fault:
            why = str(fault)
            return False
        return True

    found = largest_scale(holds, COARSE)
    if not found.value:
        raise InputFault(f"none hold down to {2.0**-DOUBLINGS:.1g} times those begun with: {why}")
    if not found.limited:
        why = f"nothing up to {found.value:g} times those begun with (not searched further)"
    return at(found.value), why


def descend(
    start: Point,
    cost: Callable[[Sequence[Point]], Sequence[Cost]],
    steps: Sequence[int],
    worth: float,
) -> Iterator[Point]:
    """Points of ever less cost, which goes down by more than `worth` in its last entry or at all in
    one before. Each is the best of those to both sides of the last one along each coordinate, by
    the first of the `steps` that has a better one; a step that has none is not taken up again. No
    point is judged twice."""
    known = dict(zip([start], cost([start]), strict=True))
    at = start
    for step in steps:
        while True:
            near = [
                tuple(n + sign * step * (i == k) for k, n in enumerate(at))
                for i in range(len(at))
                for sign in (1, -1)
            ]
            new = [point for point in near if point not in known]
            known.update(zip(new, cost(new), strict=True))
            best = min(near, key=known.__getitem__)
            *first, last = known[at]
            if not known[best] < (*first, last - worth):
                break
            at = best
            yield at


def judge_best_first(
    ranked: Sequence[Candidate],
    judge: Callable[[Sequence[Candidate]], Sequence[Judged]],
    suffices: Callable[[Judged], bool],
    at_once: int = 1,
) -> Iterator[Judged]:
    """Judges candidates, `at_once` of them together, until one of these suffices."""
    for first in range(0, len(ranked), at_once):
        judged = judge(ranked[first : first + at_once])
        yield from judged
        if any(map(suffices, judged)):
            return
