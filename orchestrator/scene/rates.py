"""Rates and times of a scene, which may be written as exact fractions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator
from pydantic_core import PydanticCustomError

from hapticlink.components.specs.quantities import Elapsed, Quantity, Seed
from hapticlink.orchestrator.base.ticks import exact


@dataclass(frozen=True)
class Exact(Quantity):
    """A quantity that may also be written as text: a fraction of whole numbers or a decimal."""

    def __iter__(self) -> Iterator[Any]:
        yield AfterValidator(self._checked)

    def _checked(self, value: int | float | str) -> int | float | str:
        try:
            number = exact(value)
        except (ValueError, ZeroDivisionError):
            raise PydanticCustomError("no_number", "no number") from None
        if number not in self:
            raise PydanticCustomError("out_of_range", "out of range")
        return value


Rate = Annotated[int | float | str, Exact("Hz", gt=0, le=1000000)]
Seconds = Annotated[int | float | str, Exact("s", gt=0, le=100000)]


@dataclass(frozen=True, kw_only=True)
class VariableRate:
    """Periods drawn uniformly between 1/max and 1/min, in whole haptic ticks."""

    min: Rate
    """Lowest rate."""
    max: Rate
    """Highest rate."""
    seed: Seed = 0
    """Seed of the generator, numpy's PCG64."""


AnyRate = Rate | VariableRate | tuple[Elapsed, ...]
"""A rate (Hz), bounds of a varying rate, or the times (s) at which steps end; a recorded trace,
`{ trace = FILE }`, is read as such times."""
