"""[step_control]: plants of a rate exchange values at steps chosen for accuracy.

The rate stays the one at which sampled blocks act and rows are written; between two of its ticks
the plants step by themselves, in whole ticks of the timeline's base, and land on the tick. So step
control never cuts a sampled block.

doubling  A step and two of half the size from the same state (Richardson): with order q of the
          coupling, the halves err by |y_2 - y_1| / (2^q - 1). A step whose error is too large is
          taken back, and so is one in which an FMU fails or gives what is not finite. The error per
          second is held at the tolerance, so that a run's error is proportional to it.
ecco      Energy-conservation-based co-simulation (Sadjina, Kyllingstad, Skjong and Pedersen 2017):
          no step is taken back. The residual energy of a power connection over a step,
          (F_held - (F_n + F_{n+1})/2) . (x_{n+1} - x_n), against the energy that matters in the
          scene, sets the next one by Gustafsson's PI rule (1991). As in the paper it is held
          per step, so that a run's error goes with tolerance^(q/(q+1)).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal

from hapticlink.orchestrator.rates import Seconds


@dataclass(frozen=True, kw_only=True)
class StepControl:
    """Settings of [step_control]; times in s, as numbers or "1/3000".

    tolerance: doubling, error per second of an output y over its nominal (1 where it has none) +
    |y|; ecco, residual energy of a step over `energy` (J), the energy that matters in the scene.
    min: the shortest step, accepted whatever its error. max: None is a period of the rate.
    """

    method: Literal["doubling", "ecco"]
    tolerance: float
    min: Seconds
    max: Seconds | None = None
    energy: float | None = None


@dataclass
class Steps:
    """What step control did on a rate: steps taken, taken back for their error, given up because
    an FMU failed in them, taken at `min` though the error was too large, the shortest and longest
    (s). A step of doubling is its two halves."""

    taken: int = 0
    rejected: int = 0
    failed: int = 0
    forced: int = 0
    shortest: float = 0.0
    longest: float = 0.0

    def count(self, size: float, forced: bool) -> None:
        self.shortest = min(self.shortest, size) if self.taken else size
        self.longest = max(self.longest, size)
        self.taken += 1
        self.forced += forced


ORDER = {"lead": 2, "foh": 2, "foh-derivative": 2, "second-order": 3, "hermite": 4}
"""Of the error over a run, by the hold between plants; 1 for any other, and for none."""


def integral(error: float, order: int) -> float:
    """The factor from the step taken to the next, where the error, in units of the tolerance, was
    `error` and grows with the step to the power `order`."""
    return 0.9 * error ** (-1 / order) if error else inf


def proportional_integral(error: float, before: float, order: int) -> float:
    """The same with the error of the step before (Gustafsson 1991: .3 and .4)."""
    if not error or not before:
        return integral(error, order)
    return 0.9 * error ** (-0.3 / order) * (before / error) ** (0.4 / order)


def rounded(ticks: float) -> int:
    """Down to four significant bits, so that few sizes occur and each is bound once; at least 1."""
    whole = max(int(ticks), 1)
    shift = max(whole.bit_length() - 4, 0)
    return whole >> shift << shift
