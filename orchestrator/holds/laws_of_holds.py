"""The laws of the holds whose value is a polynomial in time, each written once: NumPy evaluates
them in Python, and `run/compiled/generate_laws.py` turns them into the C of the compiled loop.

A law takes what it needs by name, and uses +, -, * and / alone, so that both give the same bits:

y, y1, y2         the newest sample y_n and the ones before it, or entries of them
yd, yd1           what a sample has besides: derivatives of y and y1 (per s), or their integrals
s                 time since the newest sample's stamp, t - t_n (ticks)
H, H1             periods t_n - t_{n-1} and t_{n-1} - t_{n-2} (ticks)
elapsed, period   s and H in seconds
w, wd             value and slope (per tick) that the hold had when sample n arrived
r                 time since that arrival, divided by H

The build of the package runs this file: it needs no other.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

Value = Any
"""A number, an array of numbers, or a symbol of the C code."""
Law = Callable[..., Value]


def zero_order(y: Value) -> Value:
    return y


def zero(y: Value) -> Value:
    return y - y


def lead(y: Value, y1: Value) -> Value:
    return y + (y - y1) / 2


def first_order(y: Value, y1: Value, s: Value, H: Value) -> Value:
    return y + (y - y1) / H * s


def second_order(y: Value, y1: Value, y2: Value, s: Value, H: Value, H1: Value) -> Value:
    d1 = (y - y1) / H
    d2 = (d1 - (y1 - y2) / H1) / (H + H1)
    return y + d1 * s + d2 * (s * (s + H))


def first_order_derivative(y: Value, yd: Value, elapsed: Value) -> Value:
    return y + yd * elapsed


def hermite(y: Value, yd: Value, y1: Value, yd1: Value, s: Value, H: Value, period: Value) -> Value:
    x = (s + H) / H
    falling, rising = (1 - x) * (1 - x), x * x
    before = (1 + 2 * x) * falling * y1 + x * falling * period * yd1
    return before + (3 - 2 * x) * rising * y + (x - 1) * rising * period * yd


def difference(yd: Value, yd1: Value, period: Value) -> Value:
    return (yd - yd1) / period


def line_to_sample(y: Value, w: Value, r: Value) -> Value:
    return w + (y - w) * r


def smooth(y: Value, y1: Value, w: Value, wd: Value, r: Value, H: Value) -> Value:
    falling = (1.0 - r) * (1.0 - r)
    start = w * ((1 + 2 * r) * falling) + wd * H * (r * falling)
    return start + (y * (r * r * (3 - 2 * r)) + (y - y1) * (r * r * (r - 1)))


def smooth_slope(y: Value, y1: Value, w: Value, wd: Value, r: Value, H: Value) -> Value:
    slope = (y - w) * (6 * r * (1 - r)) + wd * H * ((1 - r) * (1 - 3 * r))
    return (slope + (y - y1) * (r * (3 * r - 2))) / H


def line(y: Value, y1: Value, r: Value) -> Value:
    return y + (y - y1) * (r - 1.0)


def line_slope(y: Value, y1: Value, H: Value) -> Value:
    return (y - y1) / H


LAWS: dict[str, tuple[Law, ...]] = {
    "ZERO_ORDER": (zero_order,),
    "LEAD": (zero_order, lead),
    "FIRST_ORDER": (zero_order, first_order),
    "FIRST_ORDER_DERIVATIVE": (first_order_derivative,),
    "SECOND_ORDER": (zero_order, first_order, second_order),
    "HERMITE": (first_order_derivative, hermite),
    "SLOPE": (zero, difference),
    "DELAYED": (zero_order, line_to_sample, zero_order),
    "SMOOTH": (zero_order, smooth, line),
    "SMOOTH_SLOPE": (zero, smooth_slope, line_slope),
}
"""By the hold's name in loop.h: its laws while it has one sample, two and three. After the second
sample `delayed` and `smooth` have two laws: until it is reached, r < 1, and from there on."""


@cache
def arguments(law: Law) -> tuple[str, ...]:
    """The names of what a law needs."""
    code = law.__code__
    return code.co_varnames[: code.co_argcount]
