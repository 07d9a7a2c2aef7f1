"""The newest samples of a source with their stamps, and holds that follow from them by a law."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable
from typing import ClassVar

import numpy as np

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.hold import Hold, Vector
from hapticlink.orchestrator.holds.polynomial_hold_laws import Law, Value, arguments


class History:
    """At most `depth` samples, oldest first; a second sample with the same stamp replaces the
    first."""

    def __init__(self, depth: int) -> None:
        self._samples: deque[tuple[int, Vector]] = deque(maxlen=depth)

    def push(self, stamp: int, sample: Vector) -> None:
        if self._samples and self._samples[-1][0] == stamp:
            self._samples.pop()
        self._samples.append((stamp, sample.copy()))

    def __len__(self) -> int:
        return len(self._samples)

    def __getitem__(self, index: int) -> tuple[int, Vector]:
        return self._samples[index]

    def period(self, index: int) -> int:
        """Ticks between the stamp of a sample and that of the one before it."""
        return self._samples[index][0] - self._samples[index - 1][0]


class OfSamples(Hold):
    """Base of holds whose value follows from the newest `depth` samples by a law (`laws`)."""

    depth: ClassVar[int] = 2
    laws: ClassVar[tuple[Law, ...]]
    """The law while the hold has one sample, two, and so on."""

    def __init_subclass__(cls) -> None:
        _require_known(getattr(cls, "laws", ()), _ARGUMENTS)

    def __init__(self, context: HoldContext) -> None:
        self.size, self.seconds = context.size, context.seconds
        self.samples = History(self.depth)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self.samples.push(stamp, sample)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        law = self.laws[len(self.samples) - 1]
        time = tick - self.samples[-1][0] + ahead
        value: Vector = law(*[_ARGUMENTS[name](self, time) for name in arguments(law)])
        return value


_ARGUMENTS: dict[str, Callable[[OfSamples, float], Value]] = {
    "y": lambda hold, s: hold.samples[-1][1][: hold.size],
    "y1": lambda hold, s: hold.samples[-2][1][: hold.size],
    "y2": lambda hold, s: hold.samples[-3][1][: hold.size],
    "yd": lambda hold, s: hold.samples[-1][1][hold.size :],
    "yd1": lambda hold, s: hold.samples[-2][1][hold.size :],
    "s": lambda hold, s: s,
    "H": lambda hold, s: hold.samples.period(-1),
    "H1": lambda hold, s: hold.samples.period(-2),
    "elapsed": lambda hold, s: hold.seconds(s),
    "period": lambda hold, s: hold.seconds(hold.samples.period(-1)),
}
"""What the argument of a law is, `s` ticks after the newest stamp."""


_OF_A_TRANSITION = ("y", "y1", "w", "wd", "r", "H")


def _require_known(laws: Iterable[Law], known: Collection[str]) -> None:
    """Raises TypeError for a law with an argument that has no meaning."""
    for law in laws:
        for name in arguments(law):
            if name not in known:
                raise TypeError(
                    f"law {law.__name__!r}: no argument {name!r}; there are {', '.join(known)}"
                )


class Transition(Hold):
    """Base of holds that go from the value w which they have when a sample arrives to that sample,
    and reach it a period H later. Their laws take y, y1, w, wd, r and H."""

    depth: ClassVar[int] = 2
    laws: ClassVar[tuple[Law, ...]]
    """The law with one sample, that until the newest is reached (r < 1), and that from there on."""
    slopes: ClassVar[tuple[Law, ...] | None] = None
    """Laws of the slope (per tick), where those of the value need it."""

    def __init_subclass__(cls) -> None:
        _require_known((*getattr(cls, "laws", ()), *(cls.slopes or ())), _OF_A_TRANSITION)

    def __init__(self, context: HoldContext) -> None:
        self._samples = History(self.depth)
        self._arrival = 0
        self._from = self._slope = np.zeros(context.size)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        if not len(self._samples):
            self._from = sample.copy()
        else:
            start = self.value(arrival)
            if self.slopes:
                self._slope = self._evaluated(self.slopes, arrival, 0.0)
            self._from = start
        self._samples.push(stamp, sample)
        self._arrival = arrival

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self._evaluated(self.laws, tick, ahead)

    def _evaluated(self, laws: tuple[Law, ...], tick: int, ahead: float) -> Vector:
        (before, y1), (stamp, y) = self._samples[0], self._samples[-1]
        known: dict[str, Value] = {"y": y, "y1": y1, "w": self._from, "wd": self._slope}
        law = laws[0]
        if stamp > before:
            H = stamp - before
            r = (tick - self._arrival + ahead) / H
            known |= {"H": H, "r": r}
            law = laws[2] if r >= 1.0 else laws[1]
        value: Vector = law(*[known[name] for name in arguments(law)])
        return value
