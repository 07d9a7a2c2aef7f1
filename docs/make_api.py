"""Writes docs/api.md, the page of the public names, from their docstrings:

python docs/make_api.py
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import hapticlink as hl

PAGE = Path(__file__).with_name("api.md")
WIDTH = 88


class _Bare(str):
    """An annotation that a signature shows without quotes."""

    __repr__ = str.__str__


def page() -> str:
    """The text of docs/api.md."""
    things = {name: getattr(hl, name) for name in hl.__all__ if name != "__version__"}
    functions = {n: t for n, t in things.items() if inspect.isfunction(t)}
    raised = {n: t for n, t in things.items() if inspect.isclass(t) and issubclass(t, Exception)}
    lines = [
        "# Python API",
        "Generated from the docstrings by `python docs/make_api.py`. "
        "[first_steps.py](first_steps.py) is a script to start from.",
        _doc(hl),
        "A `Vector` is a NumPy array of floats; `scene` says what `Options` are, `sweep` what "
        "`Vary` and `Runs` are.",
        "## Functions",
    ]
    for name, function in functions.items():
        lines += [f"### {name}", _code(f"hl.{name}", function), _doc(function)]
    lines.append("## Classes")
    for name, thing in things.items():
        if thing is hl.Scene:
            lines += [f"### {name}", "A checked scene. Its keys are those of [scenes](scenes.md)."]
        elif name not in functions and name not in raised:
            lines += [f"### {name}", _doc(thing), *_fields(thing), *_members(thing)]
    lines.append("## Exceptions")
    lines += [_item(f"{n}({t.__base__.__name__})", t) for n, t in raised.items()]
    return "\n\n".join(lines) + "\n"


def _fields(thing: type) -> Iterator[str]:
    """The attributes of a record, each with the text that stands under it."""
    (record,) = ast.parse(textwrap.dedent(inspect.getsource(thing))).body
    assert isinstance(record, ast.ClassDef)
    for field, text in pairwise(record.body):
        match field, text:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(about))),
            ):
                yield f"- `.{name}`: {inspect.cleandoc(about)}".replace("\n", "\n  ")


def _members(thing: type) -> Iterator[str]:
    """The members that have a docstring of ours."""
    found = {n: m for base in reversed(thing.__mro__) for n, m in vars(base).items()}
    for name, member in found.items():
        if isinstance(member, property) and member.__doc__:
            yield _item(f".{name}", member)
        elif not inspect.isfunction(member) or not member.__module__.startswith("hapticlink"):
            continue
        elif member.__doc__ and name == "__getitem__":
            yield _item("[name]", member)
        elif member.__doc__ and not name.startswith("_"):
            yield _item(f".{name}{_signature(member)}", member)


def _item(name: str, thing: object) -> str:
    return f"- `{name}`: {_doc(thing)}".replace("\n", "\n  ").replace("\n  \n", "\n\n")


def _doc(thing: object) -> str:
    return inspect.getdoc(thing) or ""


def _code(name: str, function: Callable[..., Any]) -> str:
    text = name + _signature(function)
    if len(text) > WIDTH:
        text = name + _signature(function, "\n    ", ",\n")
    return f"```python\n{text}\n```"


def _signature(function: Callable[..., Any], before: str = "", after: str = "") -> str:
    """The signature without `self`; with `before` each parameter and `after` the last."""
    found = inspect.signature(function)
    shown = []
    for p in found.parameters.values():
        if p.kind is p.KEYWORD_ONLY and "*" not in shown:
            shown.append("*")
        if p.name != "self":
            shown.append(str(p.replace(annotation=_Bare(p.annotation))))
    inner = f",{before or ' '}".join(shown)
    return f"({before}{inner}{after}) -> {found.return_annotation}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE)
