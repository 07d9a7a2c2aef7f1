"""The communication points of a rate as a lazy sequence."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import overload


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
