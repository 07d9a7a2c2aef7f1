"""A statement of the report, compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

Verdict = Literal["agrees", "differs", "cannot be compared"]
ROUNDING = 1e-9
"""Relative deviation below which two computations of the same number agree."""
SLOPE = 1e-6
"""The same where one of them takes central differences."""


@dataclass(frozen=True)
class Statement:
    """What the report states at a place (section, and equation, figure or table), in our words; the
    verdict, the number it rests on, and the command that shows it ("-" where there is nothing)."""

    place: str
    text: str
    verdict: Verdict
    number: str
    command: str
    misprint: bool = False
    """Whether it differs in print alone."""


def compare(place: str, text: str, holds: object, number: str, command: str) -> Statement:
    """A statement that agrees if something `holds`, else differs."""
    return Statement(place, text, "agrees" if bool(holds) else "differs", number, command)


def leave(place: str, text: str, why: str, command: str = "-") -> Statement:
    """A statement that cannot be compared, and why."""
    return Statement(place, text, "cannot be compared", why, command)


def equation(place: str, text: str, error: float, test: str) -> Statement:
    """An equation that is met to a relative error, and the test that proves it."""
    return compare(place, text, error < ROUNDING, f"met {to(error)}", test_command(test))


def tested(place: str, text: str, shown: str, test: str) -> Statement:
    """A statement without a number, which agrees as long as a test of the project passes."""
    return Statement(place, text, "agrees", f"by the test: {shown}", test_command(test))


def misprint(
    place: str, text: str, printed: float, remedy: str, corrected: float, test: str
) -> Statement:
    """An equation whose printed form misses by `printed` of itself; with the remedy by
    `corrected`."""
    number = f"as printed off by {100 * printed:.0f} %; with {remedy} met {to(corrected)}"
    if printed < ROUNDING or corrected > SLOPE:
        raise ValueError(f"{place}: not the misprint that it is taken for: {number}")
    return misprinted(place, text, number, test_command(test))


def misprinted(place: str, text: str, number: str, command: str) -> Statement:
    """A statement that contradicts itself or another one, as it is printed, and what is meant."""
    return Statement(place, text, "differs", number, command, misprint=True)


def to(error: float) -> str:
    """How well something is met, by its relative error."""
    return f"to {error:.0e}" if error else "exactly"


def test_command(test: str) -> str:
    """The command that runs a test, given as file::test below tests/."""
    return f"pytest tests/{test}"


def deviation(found: ArrayLike, expected: ArrayLike) -> float:
    """Largest difference relative to the largest expected entry."""
    a, b = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    return float(np.abs(a - b).max() / max(np.abs(b).max(), 1e-300))
