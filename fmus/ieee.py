"""Scalar functions with the IEEE 754 results of C, where Python's `math` raises.

1/0 is inf, log(-1) is nan, exp(1000) is inf. This file's text precedes generated straight-line
code, which must run without this package; therefore it only needs the standard library.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from math import asinh, atan, atan2, copysign, erf, fabs, inf, isnan, nan, tanh  # noqa: F401

Function = Callable[..., float]
LookUp = Callable[[float], list[float]]


def div(a: float, b: float) -> float:
    try:
        return a / b
    except ZeroDivisionError:
        if a == 0.0 or isnan(a):
            return nan
        return copysign(inf, a) * copysign(1.0, b)


def power(a: float, b: float) -> float:
    """C's pow: infinite for 0 to a negative power; odd whole powers keep the sign."""
    try:
        return math.pow(a, b)
    except OverflowError:
        return -inf if a < 0.0 and math.fmod(b, 2.0) else inf
    except ValueError:
        if a == 0.0:
            return copysign(inf, a) if fabs(math.fmod(b, 2.0)) == 1.0 else inf
        return nan


def _overflowing(function: Function) -> Function:
    """A function, odd or positive, whose only error is overflow, made to return inf there."""

    def guarded(a: float) -> float:
        try:
            return function(a)
        except OverflowError:
            return inf if a > 0.0 or function is math.cosh else -inf

    return guarded


def _with_domain(function: Function) -> Function:
    """The function, made to return nan outside its domain."""

    def guarded(*arguments: float) -> float:
        try:
            return function(*arguments)
        except ValueError:
            return nan

    return guarded


def _with_pole(function: Function, pole: float) -> Function:
    """A logarithm, made to return -inf at its pole and nan beyond it."""

    def guarded(a: float) -> float:
        try:
            return function(a)
        except ValueError:
            return -inf if a == pole else nan

    return guarded


exp, expm1, sinh, cosh = map(_overflowing, (math.exp, math.expm1, math.sinh, math.cosh))
sqrt, sin, cos, tan = map(_with_domain, (math.sqrt, math.sin, math.cos, math.tan))
asin, acos, acosh = map(_with_domain, (math.asin, math.acos, math.acosh))
fmod, remainder = map(_with_domain, (math.fmod, math.remainder))
log, log1p = _with_pole(math.log, 0.0), _with_pole(math.log1p, -1.0)
hypot = math.hypot


def atanh(a: float) -> float:
    return copysign(inf, a) if fabs(a) == 1.0 else nan if fabs(a) > 1.0 else math.atanh(a)


def floor(a: float) -> float:
    return copysign(float(math.floor(a)), a) if math.isfinite(a) else a


def ceil(a: float) -> float:
    return copysign(float(math.ceil(a)), a) if math.isfinite(a) else a


def sign(a: float) -> float:
    return -1.0 if a < 0.0 else 1.0 if a > 0.0 else a


def fmin(a: float, b: float) -> float:
    """The smaller one; the other one if one of the two is nan."""
    return a if a < b or isnan(b) else b if not isnan(b) else a


def fmax(a: float, b: float) -> float:
    return a if a > b or isnan(b) else b if not isnan(b) else a


def if_else_zero(condition: float, value: float) -> float:
    """0 where the condition is 0, even if the value is nan."""
    return 0.0 if condition == 0.0 else value


def look_up(times: Sequence[float], rows: Sequence[Sequence[float]]) -> tuple[LookUp, LookUp]:
    """CasADi's linear interpolant of `rows` and its slope, in its order of operations
    (casadi_interpn.hpp): functions of t that return one value per column."""

    def left(t: float) -> int:
        return min(max(bisect_right(times, t) - 1, 0), len(times) - 2)

    def value(t: float) -> list[float]:
        k = left(t)
        share = (t - times[k]) / (times[k + 1] - times[k])
        pairs = zip(rows[k], rows[k + 1], strict=True)
        return [0.0 + (1.0 - share) * a + share * b for a, b in pairs]

    def slope(t: float) -> list[float]:
        k = left(t)
        width = times[k + 1] - times[k]
        return [(0.0 - a + b) / width for a, b in zip(rows[k], rows[k + 1], strict=True)]

    return value, slope
