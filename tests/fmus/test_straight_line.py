"""Generated Python against CasADi: the same doubles, special values included."""

import math
import struct
from collections.abc import Callable
from functools import cache

import casadi as ca
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hapticlink.fmus.errors import UnknownOperation
from hapticlink.fmus.straight_line import program, straight_line

UNARY = {
    name: getattr(ca, name)
    for name in (
        "exp", "expm1", "log", "log1p", "log10", "sqrt", "sin", "cos", "tan", "asin", "acos",
        "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "floor", "ceil", "fabs",
        "sign", "erf", "logic_not",
    )
} | {
    "neg": lambda a: -a,
    "square": lambda a: a * a,
    "inverse": lambda a: 1 / a,
    "twice": lambda a: 2 * a,
    "cube": lambda a: a**3,
    "root": lambda a: a**0.3,
}  # fmt: skip

BINARY = {
    name: getattr(ca, name)
    for name in (
        "atan2", "fmod", "remainder", "copysign", "fmin", "fmax", "hypot", "logic_and",
        "logic_or", "if_else_zero",
    )
    if hasattr(ca, name)
} | {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "pow": lambda a, b: a**b,
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
    "if_else": lambda a, b: ca.if_else(a > 0, b, -2),
}  # fmt: skip

SPECIAL = [0.0, -0.0, 1.0, -1.0, 2.0, -3.0, 0.5, -0.5, 2.5, 1e308, -1e308, 5e-324, 710.0]
SPECIAL += [math.inf, -math.inf, math.nan]
# No signalling nan: what C makes of one in fmax is the platform's.
doubles = st.floats(allow_nan=False) | st.floats(-5, 5) | st.sampled_from(SPECIAL)


@cache
def compiled(function: ca.Function) -> Callable:
    namespace: dict = {}
    exec(program([function]), namespace)
    return namespace[function.name()]


def both(function: ca.Function, *values: float) -> tuple[float, float]:
    result = [0.0]
    compiled(function)(*([v] for v in values), result)
    return result[0], float(function(*values))


def assert_same(got: float, expected: float, at: object) -> None:
    """To the last bits: two libraries may round a transcendental function differently."""
    assert isinstance(got, float)
    if math.isnan(expected):
        assert math.isnan(got), at
    else:
        assert got == expected or math.isclose(got, expected, rel_tol=4e-16, abs_tol=0), at
        if expected == 0.0:
            assert math.copysign(1, got) == math.copysign(1, expected), at


def unary(name: str) -> ca.Function:
    a = ca.SX.sym("a")
    return ca.Function("f", [a], [UNARY[name](a)])


def binary(name: str) -> ca.Function:
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    return ca.Function("f", [a, b], [BINARY[name](a, b)])


UNARY_FUNCTIONS = {name: unary(name) for name in UNARY}
BINARY_FUNCTIONS = {name: binary(name) for name in BINARY}


@pytest.mark.parametrize("name", UNARY)
def test_unary_at_special_values(name):
    for a in SPECIAL:
        assert_same(*both(UNARY_FUNCTIONS[name], a), (name, a))


@pytest.mark.parametrize("name", BINARY)
def test_binary_at_special_values(name):
    for a in SPECIAL:
        for b in SPECIAL:
            got, expected = both(BINARY_FUNCTIONS[name], a, b)
            if name in ("fmin", "fmax") and a == b == 0.0:
                assert got == expected  # C leaves the sign of zero open here
            else:
                assert_same(got, expected, (name, a, b))


@settings(max_examples=100)  # of nineteen functions
@given(st.sampled_from(sorted(UNARY)), doubles)
def test_unary(name, a):
    assert_same(*both(UNARY_FUNCTIONS[name], a), (name, a))


@settings(max_examples=100)
@given(st.sampled_from(sorted(set(BINARY) - {"fmin", "fmax"})), doubles, doubles)
@example("pow", -0.0, -3.0)
@example("div", -1.0, -0.0)
def test_binary(name, a, b):
    assert_same(*both(BINARY_FUNCTIONS[name], a, b), (name, a, b))


def graph() -> ca.Function:
    a, b = ca.SX.sym("a", 4), ca.SX.sym("b", 2)
    matrix = ca.reshape(a, 2, 2)
    solved = ca.solve(matrix @ matrix.T + ca.SX.eye(2), b)
    return ca.Function("f", [a, b], [ca.vertcat(solved, matrix @ b), ca.sqrt(ca.sumsqr(b))])


GRAPH = graph()


@given(st.lists(st.floats(-1e3, 1e3), min_size=6, max_size=6))
def test_a_whole_graph_bit_for_bit(values):
    """Matrix algebra with shared work registers: only correctly rounded operations."""
    first, second = [0.0] * 4, [0.0]
    compiled(GRAPH)(values[:4], values[4:], first, second)
    expected = [ca.DM(e).full().ravel() for e in GRAPH(values[:4], values[4:])]
    assert struct.pack("4d", *first) == expected[0].tobytes()
    assert struct.pack("d", *second) == expected[1].tobytes()


def test_constants_that_have_no_literal():
    a = ca.SX.sym("a")
    f = ca.Function("f", [a], [ca.if_else(a > 0, ca.SX.inf(), ca.SX.nan()) + a])
    assert both(f, 1.0)[0] == math.inf


def test_an_operation_without_a_form_is_named():
    a = ca.SX.sym("a")
    inner = ca.Function("inner", [a], [ca.sin(a)], {"never_inline": True})
    f = ca.Function("outer", [a], [inner(a)])
    with pytest.raises(UnknownOperation, match=r"`outer`, instruction \d+: inner is no"):
        straight_line(f)


def test_a_free_variable_is_named():
    a, b = ca.SX.sym("a"), ca.SX.sym("gain")
    f = ca.Function("f", [a], [a * b], {"allow_free": True})
    with pytest.raises(UnknownOperation, match="gain"):
        straight_line(f)
