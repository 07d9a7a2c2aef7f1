"""A condition on a signal, `haptic_device.workspace_margin < 0`."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable
from dataclasses import dataclass

from hapticlink.orchestrator.base.signal_names import WORKSPACE_MARGIN

COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_PATTERN = re.compile(r"\s*(\w+)\.([\w.]+(?:\[[\d,]+\])?)\s*(<=|>=|<|>)\s*(\S+)\s*")


@dataclass(frozen=True)
class Condition:
    """A comparison of a variable with a number: `fmu.variable comparison value`."""

    fmu: str
    variable: str
    comparison: str
    value: float

    def __str__(self) -> str:
        return f"{self.fmu}.{self.variable} {self.comparison} {self.value!r}"


def parse_condition(text: str) -> Condition:
    """The condition that `text` writes. Raises ValueError, with an example, where it is none."""
    match = _PATTERN.fullmatch(text)
    try:
        if match is None or not math.isfinite(value := float(match[4])):
            raise ValueError
        return Condition(match[1], match[2], match[3], value)
    except ValueError:
        example = f"{WORKSPACE_MARGIN} < 0"
        raise ValueError(f"{text!r}: write a signal against a number, {example!r}") from None
