"""Which pair comes next in a blind trial: all of them in random order, or a staircase.

In each trial somebody feels the reference and a varied setting, in an order that is drawn, and
says which of the two is the varied one (two alternatives, forced choice). A staircase goes on to
the next harder level after two right answers and to the next easier one after a wrong one, so that
it stays about where 70.7 % are right: H. Levitt, Transformed up-down methods in psychoacoustics,
The Journal of the Acoustical Society of America 49 (1971) 467-477.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

DOWN = 2
"""Right answers in a row after which a level becomes harder."""
REVERSALS = 8
"""Turns of a staircase at which it ends."""
MOST = 120
"""Trials of a staircase."""


@dataclass(frozen=True)
class TrialPair:
    """A trial: the varied setting by its index, and whether it comes first."""

    setting: int
    varied_first: bool


def in_random_order(settings: int, repeats: int, seed: int) -> Iterator[TrialPair]:
    """Each setting so often, in an order drawn by numpy's PCG64; as often first as second, but for
    one of an odd number."""
    draw = np.random.Generator(np.random.PCG64(seed))
    first = [[i % 2 == 0 for i in range(repeats)] for _ in range(settings)]
    if repeats % 2:
        for row in first:
            row[-1] = bool(draw.integers(2))
    pairs = [TrialPair(s, f) for s, row in enumerate(first) for f in row]
    for i in draw.permutation(len(pairs)):
        yield pairs[i]


class Staircase:
    """A staircase over settings from the easiest to the hardest to tell."""

    def __init__(self, settings: Sequence[int]) -> None:
        self._settings, self._at, self._row = settings, 0, 0
        self._harder: bool | None = None
        self.reversals = self.trials = 0

    @property
    def ended(self) -> bool:
        return self.reversals >= REVERSALS or self.trials >= MOST

    @property
    def setting(self) -> int:
        """The setting of the next trial."""
        return self._settings[self._at]

    def answer(self, right: bool) -> None:
        """Go on after an answer."""
        self.trials += 1
        self._row = self._row + 1 if right else 0
        if right and self._row < DOWN:
            return
        self._row = 0
        if self._harder is not None and self._harder != right:
            self.reversals += 1
        self._harder = right
        last = len(self._settings) - 1
        self._at = min(self._at + 1, last) if right else max(self._at - 1, 0)


class Staircases:
    """Several staircases, whose trials come in random order; `answer` is told of each before the
    next comes."""

    def __init__(self, stairs: Sequence[Staircase], seed: int) -> None:
        self._stairs = stairs
        self._draw = np.random.Generator(np.random.PCG64(seed))
        self._now: Staircase | None = None

    def __iter__(self) -> Iterator[TrialPair]:
        while going := [s for s in self._stairs if not s.ended]:
            self._now = going[self._draw.integers(len(going))]
            yield TrialPair(self._now.setting, bool(self._draw.integers(2)))

    def answer(self, right: bool) -> None:
        assert self._now
        self._now.answer(right)
