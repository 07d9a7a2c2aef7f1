"""Writes a CasADi function as straight-line Python text that only needs `math`.

The Python of an importer may lack casadi (277 MB), or have a version that cannot read this one's
files: a Python FMU runs there as well, only slower.

Each instruction of CasADi's virtual machine becomes one assignment, in the same order, so that both
evaluations do the same operations on the same numbers. A generated function reads its arguments and
writes its results in place:

    def step(a0, a1, r0):        # r0[i] = ...

A look-up in rows over time is a function of its own, with its rows written once in the text.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import casadi as ca

from hapticlink.components.time_signals import LookUp
from hapticlink.fmus import ieee
from hapticlink.fmus.errors import UnknownOperation

# A name in `UNARY` and `BINARY` is a function of ieee.py.
UNARY = """exp expm1 log log1p sqrt sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh
           floor ceil fabs sign erf"""
BINARY = "atan2 fmod remainder copysign fmin fmax hypot if_else_zero"

# Plain arithmetic uses operators; division and powers do not, since they raise in Python.
TEMPLATES: dict[int, str] = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "div({0}, {1})",
    ca.OP_NEG: "-{0}",
    ca.OP_INV: "div(1.0, {0})",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_POW: "power({0}, {1})",
    ca.OP_CONSTPOW: "power({0}, {1})",
    ca.OP_LT: "1.0 if {0} < {1} else 0.0",
    ca.OP_LE: "1.0 if {0} <= {1} else 0.0",
    ca.OP_EQ: "1.0 if {0} == {1} else 0.0",
    ca.OP_NE: "1.0 if {0} != {1} else 0.0",
    ca.OP_NOT: "0.0 if {0} else 1.0",
    ca.OP_AND: "1.0 if {0} and {1} else 0.0",
    ca.OP_OR: "1.0 if {0} or {1} else 0.0",
    ca.OP_LIFT: "{0}",
    ca.OP_PRINTME: "{0}",
}
TEMPLATES |= {getattr(ca, f"OP_{name.upper()}"): name + "({0})" for name in UNARY.split()}
TEMPLATES |= {getattr(ca, f"OP_{name.upper()}"): name + "({0}, {1})" for name in BINARY.split()}

_NAMES = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}


def straight_line(function: ca.Function) -> str:
    """The text of a Python function with the same name.

    Raises UnknownOperation for an instruction that is neither scalar arithmetic nor a look-up
    (such as an external call or a solver), and for a free variable.
    """
    if not function.is_a("SXFunction"):
        function = function.expand()
    if function.has_free():
        raise UnknownOperation(f"`{function.name()}` has free variables {function.get_free()}")
    lines = [_instruction(function, k) for k in range(function.n_instructions())]
    arguments = [f"a{i}" for i in range(function.n_in())]
    results = [f"r{i}" for i in range(function.n_out())]
    head = f"def {function.name()}({', '.join(arguments + results)}):"
    return "\n".join([head, *(f"    {line}" for line in lines or ["pass"])]) + "\n"


def _instruction(function: ca.Function, k: int) -> str:
    operation = function.instruction_id(k)
    into, of = function.instruction_output(k), function.instruction_input(k)
    if operation == ca.OP_CONST:
        return f"w{into[0]} = {_literal(function.instruction_constant(k))}"
    if operation == ca.OP_INPUT:
        return f"w{into[0]} = a{of[0]}[{of[1]}]"
    if operation == ca.OP_OUTPUT:
        return f"r{into[0]}[{into[1]}] = w{of[0]}"
    if operation == ca.OP_CALL:
        given = ", ".join("_" if i < 0 else f"w{i}" for i in into)  # below 0 where nobody reads it
        return f"{given}, = {_name_of_call(function, k)}(w{of[0]})"
    template = TEMPLATES.get(operation)
    if template is None:
        name = _NAMES.get(operation, str(operation))
        raise UnknownOperation(
            f"`{function.name()}`, instruction {k}: {name} has no straight-line Python form; "
            "write the expression with scalar operations"
        )
    return f"w{into[0]} = " + template.format(*(f"w{i}" for i in of))


def _name_of_call(function: ca.Function, k: int) -> str:
    """The name of the look-up that instruction k calls."""
    called = function.instructions_sx()[k].which_function()
    if called.class_name() not in ("LinearInterpolant", "LinearInterpolantJac"):
        raise UnknownOperation(
            f"`{function.name()}`, instruction {k}: {called.name()} is no look-up, and nothing "
            "else can be called in straight-line Python"
        )
    return str(called.name())


def _literal(value: float) -> str:
    """A Python literal of the same double; inf and nan are names."""
    return repr(float(value)) if math.isfinite(value) else f"float({str(value)!r})"


def program(functions: Iterable[ca.Function], look_ups: Iterable[LookUp] = ()) -> str:
    """A text that defines all `functions` and the `look_ups` that they call; it is to be executed
    in an empty namespace."""
    helpers = Path(ieee.__file__).read_text(encoding="utf-8")
    data = (
        f"{of.called}, jac_{of.called} = look_up({of.grid.tolist()}, {of.values.tolist()})\n"
        for of in look_ups
    )
    return "\n\n".join([helpers, *data, *(straight_line(f) for f in functions)])
