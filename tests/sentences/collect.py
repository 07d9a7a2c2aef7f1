"""The sentences of the product that claim something: those that are printed, drawn or shown, and
that have a word of CLAIMS. An expression in a sentence is {}, however it is written.

Left out is what claims no more than the condition under which it is said: what an error says of a
mistake in the input (`raise`, and the rooms REFUSING), and docstrings, which nobody is shown.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROOMS = [
    "components",
    "fmus",
    "orchestrator",
    "programs",
    "analysis",
    "visualization",
    "api",
    "commands",
]
INPUT = ["scene", "system", "ssp", "fmi", "holds", "network", "base"]
REFUSING = (
    *(f"orchestrator/{room}/" for room in INPUT),
    *("components/", "fmus/", "commands/reproduce", "programs/refusals.py", "programs/foreign.py"),
)
"""Rooms whose sentences are of input that is refused, or describe a port or a key."""
CLAIMS = re.compile(
    r"\b(stable|unstable|marginal|passive|margins?|remedy|diverge[sd]?|generat\w+|dissipat\w+|"
    r"drifts?|vibrat\w+|grows?|decays?|at least|at most|up to|always|never|none|nothing|no|"
    r"every\w*|all|only|cannot|by itself|because|enough|the same|agree|steady|warning|less|than|"
    r"whatever|would|decides?|follows|down to|not held|not seen)\b",
    re.IGNORECASE,
)
WORDS = 2
"""Of letters, that a sentence has at least."""
TOKEN = re.compile(r"""(?<=\s)//[^\n]*|^//[^\n]*|/\*.*?\*/|\\.|\$\{|.""", re.DOTALL | re.MULTILINE)
SHOWN = re.compile(r'>([^<>{}]+)<|(?:title|aria-label|alt|placeholder)="([^"]+)"')


def sentences() -> dict[str, list[str]]:
    """The sentences that claim something, in order, by the file that has them."""
    found = {}
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*")):
            name = path.relative_to(ROOT).as_posix()
            read = READERS.get(path.suffix)
            if read is None or name.startswith(REFUSING):
                continue
            said = dict.fromkeys(filter(claims, read(path.read_text(encoding="utf-8"))))
            if said:
                found[name] = [*said]
    return found


def claims(text: str) -> bool:
    words = re.findall(r"[A-Za-z]{2,}", text)
    return len(words) >= WORDS and " " in text.strip() and bool(CLAIMS.search(text))


def of_python(text: str) -> Iterator[str]:
    """Strings that are no docstring, no part of another one and in no `raise`."""
    tree = ast.parse(text)
    left_out = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        ):
            left_out |= {id(part) for part in ast.walk(node)}
        if isinstance(node, ast.JoinedStr):
            left_out |= {id(part) for part in node.values if isinstance(part, ast.Constant)}
            left_out |= {
                id(part)
                for value in node.values
                if isinstance(value, ast.FormattedValue) and value.format_spec
                for part in ast.walk(value.format_spec)
            }
    for node in ast.walk(tree):
        if id(node) in left_out:
            continue
        if isinstance(node, ast.JoinedStr):
            parts = (p.value if isinstance(p, ast.Constant) else "{}" for p in node.values)
            yield "".join(map(str, parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def of_script(text: str) -> Iterator[str]:
    """Literals of JavaScript: each template, and each literal in an expression of one."""
    found: list[list[str]] = []
    inside: list[tuple[str, list[str]]] = []
    """Open literals and, as "{", open braces, from the outermost on."""
    for token in TOKEN.finditer(text):
        mark, where = token[0], inside[-1][0] if inside else ""
        if where and where != "{":
            if mark == where:
                inside.pop()
            elif where == "`" and mark == "${":
                inside[-1][1].append("{}")
                inside.append(("{", []))
            elif mark != "\\\n":
                inside[-1][1].append(mark)
        elif mark in "\"'`":
            found.append([])
            inside.append((mark, found[-1]))
        elif mark == "{" or (mark == "}" and where):
            inside.append(("{", [])) if mark == "{" else inside.pop()
    yield from map("".join, found)


def of_page(text: str) -> Iterator[str]:
    """Text and titles of HTML."""
    for shown in SHOWN.finditer(text):
        yield unescape(" ".join(next(filter(None, shown.groups()), "").split()))


READERS = {".py": of_python, ".js": of_script, ".html": of_page}
