"""Exact time: every instant is a whole number of ticks of one base.

The base is the greatest common divisor of all periods (512 Hz and 30 Hz: 1/7680 s), so rates
that do not divide each other never meet a rounded float.
"""

from __future__ import annotations

import math
import re
import sys
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import overload


@lru_cache(1024, typed=True)
def exact(number: int | float | str) -> Fraction:
    """The rational number that is written: 2997/100 for 29.97, 30000/1001 for "30000/1001".

    Raises ValueError for text that is no number, and for one of more than 50 characters or with an
    exponent of four digits; ZeroDivisionError for a zero denominator.
    """
    text = str(number)
    if len(text) > 50 or re.search(r"[eE][+-]?\d{4}", text):
        raise ValueError(f"{text[:50]!r}: too long a number")
    return Fraction(text)


def write_exact(number: Fraction) -> str:
    """A number as `exact` reads it: decimal where six digits hold it, a fraction otherwise."""
    decimal = f"{float(number):g}"
    return decimal if exact(decimal) == number else str(number)


class Frames(Sequence[int]):
    """The ticks `at(0)` to `at(count - 1)`, computed when they are read, so that a long run needs
    no memory for them. Their spacing repeats with the period `round`."""

    def __init__(self, tick_of: Callable[[int], int], count: int, round: int) -> None:
        self._at, self._count, self.round = tick_of, count, round

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, i: int) -> int: ...
    @overload
    def __getitem__(self, i: slice) -> tuple[int, ...]: ...
    def __getitem__(self, i: int | slice) -> int | tuple[int, ...]:
        if isinstance(i, slice):
            return tuple(map(self._at, range(self._count)[i]))
        return self._at(range(self._count)[i])

    @property
    def repeats(self) -> int:
        """The ticks after which the spacing repeats, however many frames there are."""
        return self._at(self.round + 1) - self._at(1)

    @property
    def endless(self) -> Frames:
        """The same instants, with as many more as can be counted."""
        return Frames(self._at, sys.maxsize, self.round)

    def times(self, factor: int) -> Frames:
        """The same instants in ticks that are shorter by `factor`."""
        tick_of = self._at
        return Frames(lambda i: tick_of(i) * factor, self._count, self.round)


@dataclass(frozen=True)
class Clock:
    """The communication points of a rate, in ticks: each starts a step and ends the one before.

    The last one is at or after the end of the run.
    """

    name: str
    starts: Sequence[int]
    key: tuple[str | int, ...] = field(default=(), compare=False)
    """The scene's key that sets the rate, for messages."""

    @property
    def first(self) -> int:
        """The first step (ticks)."""
        return self.starts[1]

    @cached_property
    def longest(self) -> int:
        """The longest step (ticks)."""
        return max(self._steps)

    @cached_property
    def shortest(self) -> int:
        """The shortest step (ticks) after the first."""
        return min(self._steps[1:], default=self.longest)

    @cached_property
    def _steps(self) -> list[int]:
        """The step sizes (ticks) in order, up to where they repeat."""
        starts = self.starts
        if isinstance(starts, range):
            return [starts.step]
        if isinstance(starts, Frames):
            starts = starts[: starts.round + 2]
        return [b - a for a, b in pairwise(starts)]

    @property
    def period(self) -> int | None:
        """Size of every step but the first (ticks); None where it varies."""
        return self.longest if self.longest == self.shortest else None


@dataclass(frozen=True)
class Timeline:
    """All clocks on one base of time. base: a tick (s). end: the last tick. clocks: the haptic one
    first. of: the name of each FMU's clock. begin: the time (s) of tick 0."""

    base: Fraction
    end: int
    clocks: tuple[Clock, ...]
    of: Mapping[str, str] = field(default_factory=dict)
    begin: Fraction = Fraction(0)

    @cached_property
    def seconds(self) -> Callable[[float], float]:
        """The correctly rounded length (s) of a number of ticks (true division of integers rounds
        once)."""
        numerator, denominator = self.base.numerator, self.base.denominator
        return lambda ticks: ticks * numerator / denominator

    @cached_property
    def ratio(self) -> tuple[int, int, int]:
        """Integers n, b and d, of which (n tick + b)/d is the time (s) of a tick."""
        d = math.lcm(self.base.denominator, self.begin.denominator)
        return int(self.base * d), int(self.begin * d), d

    def time(self, tick: int, parts: int = 1) -> float:
        """The correctly rounded time (s) at `tick`, which counts from the beginning of the run in
        ticks, or in `parts` of one."""
        n, b, d = self.ratio
        return (tick * n + b * parts) / (d * parts)

    def ticks_until(self, time: Fraction) -> Fraction:
        """The ticks from the beginning of the run to a time (s)."""
        return (time - self.begin) / self.base

    def points(self, clock: Clock) -> int:
        """The number of a clock's communication points within the run."""
        return min(bisect_right(clock.starts, self.end), len(clock.starts) - 1)

    def clock(self, name: str) -> Clock:
        return next(c for c in self.clocks if c.name == name)


def common_base(periods: Sequence[Fraction]) -> Fraction:
    """The greatest common divisor of `periods`."""
    denominator = math.lcm(*(p.denominator for p in periods))
    return Fraction(math.gcd(*(int(p * denominator) for p in periods)), denominator)


def periodic(
    period: Fraction, base: Fraction, end: int, first: Fraction | None = None
) -> Sequence[int]:
    """The ticks 0, 1, 2, ... periods (s), or 0, `first` (s) and then whole periods; they go on to
    two periods past `end`, so that the last step of the run has an end.

    Raises ValueError where the period or `first` is not a whole number of ticks.
    """
    ticks = period / base
    if ticks.denominator != 1:
        raise ValueError(f"a period of {period} s is not a whole number of ticks of {base} s")
    if first is None or first == period:
        return range(0, end + 2 * int(ticks) + 1, int(ticks))
    begin = first / base
    if begin.denominator != 1:
        raise ValueError(f"a phase of {first} s is not a whole number of ticks of {base} s")
    count = len(range(int(begin), end + 2 * int(ticks) + 1, int(ticks)))
    return Frames(lambda i: int(begin) + (i - 1) * int(ticks) if i else 0, count + 1, 1)


def align_to_ticks(
    period: Fraction, base: Fraction, end: int, first: Fraction | None = None
) -> Frames:
    """Frame i at the first tick at or after i periods, ceil(i period / base), or with `first` (s),
    at or after `first` and i - 1 periods.

    Raises ValueError for a period shorter than a tick, where two frames would fall on one tick.
    """
    if period < base:
        raise ValueError(f"{1 / period} Hz on ticks of {base} s: take align = 'exact'")
    frames = math.ceil(end * base / period) + 2
    early = Fraction(0) if first is None else period - first
    return Frames(
        lambda i: math.ceil((i * period - early) / base) if i else 0,
        frames + 2,
        (period / base).denominator,
    )


MAX_DRAWN = 1_000_000
"""Largest number of drawn periods: about 100 MB and some seconds; 4.6 h at 60 Hz."""


def variable(
    slowest: Fraction, fastest: Fraction, seed: int, base: Fraction, end: int
) -> tuple[int, ...]:
    """Starts of steps (ticks) whose periods are drawn uniformly between 1/fastest and 1/slowest
    (rates, Hz), in whole ticks, by numpy's PCG64 with `seed`.

    Raises ValueError where no whole number of ticks lies between the bounds, and where more than
    MAX_DRAWN periods may be needed.
    """
    import numpy as np

    low, high = bounds(slowest, fastest, base)
    if end // low > MAX_DRAWN:
        raise ValueError(
            f"up to {end // low} periods would be drawn before the run, at most {MAX_DRAWN} are: "
            "take a shorter duration or a fixed rate"
        )
    generator = np.random.Generator(np.random.PCG64(seed))
    starts = [0]
    while starts[-1] <= end + high:
        starts.append(starts[-1] + int(generator.integers(low, high, endpoint=True)))
    return tuple(starts)


def bounds(slowest: Fraction, fastest: Fraction, base: Fraction) -> tuple[int, int]:
    """The shortest and the longest period of `variable`, in ticks. Raises ValueError where no whole
    number of ticks lies between the bounds."""
    low, high = math.ceil(1 / (fastest * base)), math.floor(1 / (slowest * base))
    if not 1 <= low <= high:
        raise ValueError(f"no period between {fastest} and {slowest} Hz is a whole haptic tick")
    return low, high


def round_up_to_ticks(times: Sequence[Fraction], base: Fraction) -> tuple[int, ...]:
    """Starts of steps (ticks): 0, and the first tick at or after each of the times (s).

    Raises ValueError where two times fall on one tick or are not in order.
    """
    starts = [0]
    for time in times:
        tick = math.ceil(time / base)
        if time == 0 and starts == [0]:
            continue
        if tick <= starts[-1]:
            raise ValueError(
                f"frame time {float(time)} s falls on tick {tick}, not after tick {starts[-1]} of "
                f"the frame before: keep frames at least {float(base)} s apart, in order"
            )
        starts.append(tick)
    return tuple(starts)
