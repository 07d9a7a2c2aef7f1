"""The newest samples of a source with their stamps, and holds that follow from them by a law."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from hapticlink.orchestrator.holds.hold import Hold, HoldContext, Vector
from hapticlink.orchestrator.holds.laws_of_holds import Law, Value, arguments


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
    laws: ClassVar[tuple[Law, ...]] = ()
    """The law while the hold has one sample, two, and so on."""
    slopes: ClassVar[tuple[Law, ...]] = ()
    """Laws of the slope (per tick), where a transition needs it."""
    known: ClassVar[tuple[str, ...]] = (
        *("y", "y1", "y2", "yd", "yd1"),
        *("s", "H", "H1", "elapsed", "period"),
    )
    """The arguments that the laws may have."""

    def __init_subclass__(cls) -> None:
        """Raises TypeError for a law with an argument that has no meaning."""
        for law in (*cls.laws, *cls.slopes):
            if unknown := [name for name in arguments(law) if name not in cls.known]:
                why = f"no argument {unknown[0]!r}; there are {', '.join(cls.known)}"
                raise TypeError(f"law {law.__name__!r}: {why}")

    def __init__(self, context: HoldContext) -> None:
        self.size, self.seconds = context.size, context.seconds
        self.samples = History(self.depth)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self.samples.push(stamp, sample)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self.evaluated(self.laws[len(self.samples) - 1], tick, ahead)

    def evaluated(self, law: Law, tick: int, ahead: float) -> Vector:
        """The value of a law."""
        value: Vector = law(*[_ARGUMENTS[name](self, tick, ahead) for name in arguments(law)])
        return value


class Transition(OfSamples):
    """Base of holds that go from the value w which they have when a sample arrives to that sample,
    and reach it a period H later. Their laws are that with one sample, that until the newest is
    reached (r < 1), and that from there on."""

    known = ("y", "y1", "w", "wd", "r", "H")

    def __init__(self, context: HoldContext) -> None:
        super().__init__(context)
        self.arrival = 0
        self.start = self.slope = np.zeros(context.size)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        if not len(self.samples):
            self.start = sample.copy()
        else:
            start = self.value(arrival)
            if self.slopes:
                self.slope = self._chosen(self.slopes, arrival, 0.0)
            self.start = start
        super().push(stamp, sample, arrival)
        self.arrival = arrival

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self._chosen(self.laws, tick, ahead)

    def _chosen(self, laws: tuple[Law, ...], tick: int, ahead: float) -> Vector:
        which = len(self.samples) - 1
        if which and _ARGUMENTS["r"](self, tick, ahead) >= 1.0:
            which = 2
        return self.evaluated(laws[which], tick, ahead)


_ARGUMENTS: dict[str, Callable[[Any, int, float], Value]] = {
    "y": lambda hold, tick, ahead: hold.samples[-1][1][: hold.size],
    "y1": lambda hold, tick, ahead: hold.samples[-2][1][: hold.size],
    "y2": lambda hold, tick, ahead: hold.samples[-3][1][: hold.size],
    "yd": lambda hold, tick, ahead: hold.samples[-1][1][hold.size :],
    "yd1": lambda hold, tick, ahead: hold.samples[-2][1][hold.size :],
    "s": lambda hold, tick, ahead: tick - hold.samples[-1][0] + ahead,
    "H": lambda hold, tick, ahead: hold.samples.period(-1),
    "H1": lambda hold, tick, ahead: hold.samples.period(-2),
    "elapsed": lambda hold, tick, ahead: hold.seconds(tick - hold.samples[-1][0] + ahead),
    "period": lambda hold, tick, ahead: hold.seconds(hold.samples.period(-1)),
    "w": lambda hold, tick, ahead: hold.start,
    "wd": lambda hold, tick, ahead: hold.slope,
    "r": lambda hold, tick, ahead: (tick - hold.arrival + ahead) / hold.samples.period(-1),
}
"""What the argument of a law is, of a hold that is read at `tick` for `ahead` ticks later."""
