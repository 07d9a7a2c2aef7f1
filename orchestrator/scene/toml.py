"""TOML of bounded size and depth: what reads it takes time in proportion to its length."""

from __future__ import annotations

import re
import tomllib
from typing import Any

LARGEST = 2**23
"""Bytes of a scene; a recorded trace of frames is a file of its own."""
DEEPEST = 32
"""Brackets within one another, and names of a dotted key."""

TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?(?:"""(?:"{0,2})|\Z)'  # multi-line strings may hold anything
    r"|'''.*?(?:'''(?:'{0,2})|\Z)"
    r'|"(?:\\.|[^"\\\n])*"?'
    r"|'[^'\n]*'?"
    r"|#[^\n]*"
    r"|[\[\]{}\n]",
    re.DOTALL,
)
"""Strings, comments, brackets and ends of lines. What is not closed goes to its end: looked at
once, as all else."""
_APART = re.compile("[=,]")


def loads(text: str) -> dict[str, Any]:
    """The tables of a TOML text. Raises ValueError, for what is too deep too."""
    _require_shallow(text)
    return tomllib.loads(text)


def _require_shallow(text: str) -> None:
    """Because tomllib recurses into brackets and takes the square of a dotted key's length."""
    begin = names = 0
    around: list[int] = []  # names before each bracket that is open
    for token in TOKEN.finditer(text + "\n"):
        for i, part in enumerate(_APART.split(text[begin : token.start()])):
            names = part.count(".") + (0 if i else names)
            if names + sum(around) + len(around) >= DEEPEST:
                line = text.count("\n", 0, begin) + 1
                raise ValueError(f"more than {DEEPEST} names or brackets deep (at line {line})")
        begin = token.end()
        if token[0] in ("[", "{"):
            around.append(names)
        elif token[0] in ("]", "}"):
            names = around.pop() if around else 0
        if token[0] in ("[", "{", "\n"):
            names = 0
