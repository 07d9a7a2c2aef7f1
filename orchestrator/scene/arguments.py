"""Arguments of functions, in the ranges that the same quantities have in a scene."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any, get_args

from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.base.errors import InputFault, shorten


def require(name: str, value: object, kind: Any) -> float:
    """`value` as a number of `kind`, a type of `components.specs.quantities` such as Elapsed.
    Raises InputFault where it is no finite number in that range, nor a whole one where `kind` is
    whole."""
    number_type, quantity = get_args(kind)
    assert isinstance(quantity, Quantity)
    whole = number_type is int
    what = f"a {'whole ' if whole else ''}number"
    unit = "" if quantity.unit == "1" else f" {quantity.unit}"
    if isinstance(value, Real) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if math.isfinite(number) and number in quantity and not (whole and number % 1):
            return number_type(value)
    raise InputFault(f"{name} = {value!r}{unit}: give {what} {quantity.range}{unit}")


def require_name(what: str, value: object) -> str:
    """`value` as a name. Raises InputFault where it is no text."""
    if isinstance(value, str):
        return value
    raise InputFault(f"{what} = {shorten(repr(value))}: give its name")
