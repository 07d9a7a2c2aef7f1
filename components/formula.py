"""Formulas that a scene writes as text, as expressions of a graph."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca

from hapticlink.components.registry import unknown

LONGEST = 1000
"""Characters of a formula."""
CONSTANTS = {"pi": math.pi, "e": math.e}
FUNCTIONS: dict[str, tuple[int, Callable[..., ca.SX]]] = {
    **{
        name: (1, getattr(ca, name))
        for name in (
            *("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
            *("exp", "log", "sqrt", "floor", "ceil", "sign"),
        )
    },
    "abs": (1, ca.fabs),
    "atan2": (2, ca.atan2),
    "min": (2, ca.fmin),
    "max": (2, ca.fmax),
    "where": (3, ca.if_else),
}
"""By name, the number of arguments, and the function."""
_OPERATORS: dict[type[ast.AST], Callable[..., ca.SX]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Mod: lambda a, b: a - b * ca.floor(a / b),
    ast.Pow: lambda a, b: a**b,
    ast.USub: lambda a: -a,
    ast.UAdd: lambda a: a,
    ast.Lt: lambda a, b: a < b,
    ast.LtE: lambda a, b: a <= b,
    ast.Gt: lambda a, b: a > b,
    ast.GtE: lambda a, b: a >= b,
}


def expression(text: str, variables: Mapping[str, ca.SX]) -> ca.SX:
    """The expression that `text` writes in Python's notation, in these variables, CONSTANTS and
    FUNCTIONS. A comparison is 1 or 0; `a % b` has the sign of b; `where(c, a, b)` is a where c is
    not 0, else b. Raises ValueError for anything else."""
    names = {**variables, **{name: ca.SX(value) for name, value in CONSTANTS.items()}}

    def read(node: ast.AST) -> ca.SX:
        match node:
            case ast.Constant(value=bool() | int() | float() as number):
                if not math.isfinite(number):
                    raise ValueError(f"{_written(node)} is no finite number")
                return ca.SX(float(number))
            case ast.Name(id=name):
                if name not in names:
                    raise ValueError(unknown("variable of a formula", name, names))
                return names[name]
            case ast.BinOp(left=a, op=op, right=b) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](read(a), read(b))
            case ast.UnaryOp(op=op, operand=a) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](read(a))
            case ast.Compare(left=a, ops=[op], comparators=[b]) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](read(a), read(b))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                if name not in FUNCTIONS:
                    raise ValueError(unknown("function of a formula", name, FUNCTIONS))
                count, function = FUNCTIONS[name]
                if len(arguments) != count:
                    raise ValueError(f"{name} takes {count} arguments, not {len(arguments)}")
                return function(*map(read, arguments))
        raise ValueError(f"{_written(node)!r} is nothing that a formula may have")

    if len(text) > LONGEST:
        raise ValueError(f"a formula of {len(text)} characters: at most {LONGEST}")
    try:
        return ca.SX(read(ast.parse(text.strip(), mode="eval").body))
    except (SyntaxError, RecursionError, MemoryError) as error:
        why = getattr(error, "msg", "") or "too deep"
        raise ValueError(f"{why}; write a formula such as 0.5*sin(2*pi*3*t)") from None


def _written(node: Any) -> str:
    return ast.unparse(node)[:100]
