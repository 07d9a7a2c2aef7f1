"""Timelines of two rates."""

from fractions import Fraction

from hapticlink.orchestrator.ticks import (
    Clock,
    Timeline,
    aligned,
    common_base,
    periodic,
    variable,
)


def fixed(haptics: Fraction, graphics: Fraction, steps: int, align: str = "exact") -> Timeline:
    fast, slow = 1 / haptics, 1 / graphics
    base = common_base([fast, slow]) if align == "exact" else fast
    end = steps * int(fast / base)
    frames = periodic(slow, base, end) if align == "exact" else aligned(slow, base, end)
    return Timeline(
        base, end, (Clock("haptics", periodic(fast, base, end)), Clock("graphics", frames))
    )


def varying(haptics: Fraction, low: Fraction, high: Fraction, seed: int, steps: int) -> Timeline:
    base = 1 / haptics
    frames = variable(low, high, seed, base, steps)
    return Timeline(
        base, steps, (Clock("haptics", periodic(base, base, steps)), Clock("graphics", frames))
    )


def single(rate: int, steps: int) -> Timeline:
    base = Fraction(1, rate)
    return Timeline(base, steps, (Clock("haptics", periodic(base, base, steps)),))
