"""Rates and times that a scene may write exactly."""

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
    """Seed of numpy's PCG64, which draws."""


AnyRate = Rate | VariableRate | tuple[Elapsed, ...]
"""A tuple holds the times (s) at which steps end. A file may also give a recorded trace,
`{ trace = FILE }`, which becomes such times."""
