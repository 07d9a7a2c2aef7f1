"""The Clocks that an FMU of FMI 3.0 declares (section 2.2.9)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from math import floor
from xml.etree.ElementTree import Element

PERIODIC, APERIODIC = ("constant", "fixed", "tunable"), ("changing", "countdown")
"""The kinds of clocks whose instants the FMU tells, by intervalVariability. The others are
triggered: by the FMU those that are outputs, by a connection those that are inputs."""


@dataclass(frozen=True)
class FmiClock:
    """A Clock. Of a periodic one, interval and shift (s); the interval is None where its FMU tells
    it in initialisation mode only."""

    name: str
    reference: int
    causality: str
    kind: str
    interval: Fraction | None = None
    shift: Fraction = Fraction(0)

    def first_after(self, time: float, start: Fraction) -> float:
        """The first instant start + shift + k interval, k = 0, 1, ..., of a periodic clock after
        `time` (s), with the start time of the run (FMI 3.0.2 section 2.2.8)."""
        assert self.interval
        first = start + self.shift
        periods = floor((Fraction(time) - first) / self.interval) + 1
        return float(first + max(periods, 0) * self.interval)

    def timed(self, interval: float, shift: float) -> FmiClock:
        """The clock with an interval and a shift (s), which stand for the shortest decimals."""
        return replace(self, interval=Fraction(repr(interval)), shift=Fraction(repr(shift)))


def read_clocks(tree: Element) -> Iterator[FmiClock]:
    """The clocks of a modelDescription.xml. Raises ValueError for one whose interval is no positive
    time, or that may tell another one at any event (tunable, without intervalDecimal)."""
    for variable in tree.iterfind("./ModelVariables/Clock"):
        about = variable.attrib
        name, kind = about.get("name", ""), about.get("intervalVariability", "")
        own = FmiClock(name, int(about["valueReference"]), about.get("causality", "local"), kind)
        if kind in PERIODIC:
            shift = _time(about, "shift") or Fraction(0)
            own = replace(own, interval=_time(about, "interval"), shift=shift)
            if own.interval is not None and own.interval <= 0:
                raise ValueError(f"clock {name}: its interval is {float(own.interval):g} s")
        if kind in ("constant", "tunable") and own.interval is None:
            raise ValueError(f"clock {name} is {kind} and states no interval")
        yield own


def _time(about: dict[str, str], what: str) -> Fraction | None:
    if f"{what}Counter" in about and "resolution" in about:
        return Fraction(int(about[f"{what}Counter"]), int(about["resolution"]))
    return Fraction(about[f"{what}Decimal"]) if f"{what}Decimal" in about else None
