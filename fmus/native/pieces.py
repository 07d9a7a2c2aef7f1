"""Splits long C functions of straight-line code into pieces that compile in linear time.

The time to compile a function grows faster than its length (190,000 statements: 29 s as three
functions, 12 s in pieces). A piece is a function that is not inlined; the slots of CasADi's work
vector that it shares with other pieces are in an array `a`, all others are its local variables.
Every statement stays as it is, so that the results are the same, bit for bit.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

LONGEST = 100_000
"""Statements that stay one function, since in pieces it takes up to 30 % longer to run: N-four-bar
of 40 windows, RK4, 86,000 statements, which compile in 15 s, and in 7 s in pieces."""
PIECE = 300
FILE = 60
"""Pieces in a file."""

_FUNCTION = re.compile(
    r"^static int (\w+)\(([^)]*)\) \{\n(?:  casadi_real [a\d, ]+;\n)+(.*?)^  return 0;\n\}\n",
    re.MULTILINE | re.DOTALL,
)
_SLOT = re.compile(r"\ba\d+\b")
_HELPER = re.compile(r"^(?=(?:casadi_real|casadi_int|void) casadi_)", re.MULTILINE)


def split(text: str) -> tuple[str, tuple[str, ...]]:
    """The C text with each long function replaced by calls of its pieces, and the files of pieces.
    `text` is CasADi's, with static functions."""
    pieces: list[str] = []

    def shortened(found: re.Match[str]) -> str:
        name, parameters, body = found.groups()
        statements = body.splitlines(keepends=True)
        if len(statements) <= LONGEST:
            return found[0]
        heads = []
        for head, piece in _pieces(name, parameters, statements):
            heads.append(head)
            pieces.append(f"{head} {piece}")
        size = 1 + max(int(slot[1:]) for slot in _SLOT.findall(body))
        calls = (f"  if (part{k}_{name}(arg, res, iw, w, mem, a)) return 1;\n"
                 for k in range(len(heads)))  # fmt: skip
        return (
            f"{''.join(f'{head};' for head in heads)}\nstatic int {name}({parameters}) {{\n"
            f"  casadi_real a[{size}];\n{''.join(calls)}  return 0;\n}}\n"
        )

    main = _FUNCTION.sub(shortened, text)
    if not pieces:
        return main, ()
    main = _HELPER.sub("static ", main)  # it is part of every file
    return main, tuple(main + "".join(pieces[k : k + FILE]) for k in range(0, len(pieces), FILE))


def _pieces(name: str, parameters: str, statements: list[str]) -> Iterator[tuple[str, str]]:
    """(head, body) of each piece."""
    slots = [_slots(statement) for statement in statements]
    bounds = [slice(k, k + PIECE) for k in range(0, len(statements), PIECE)]
    after: list[set[str]] = []  # by piece: slots whose values later pieces read
    live: set[str] = set()
    for piece in reversed(bounds):
        after.append(live.copy())
        for written, read in reversed(slots[piece]):
            live.discard(written)
            live.update(read)
    before: set[str] = set()
    for k, (piece, needed) in enumerate(zip(bounds, reversed(after), strict=True)):
        written = {slot for slot, _ in slots[piece]} - {""}
        every = sorted(written.union(*(read for _, read in slots[piece])))
        declared = f"  casadi_real {', '.join(every)};\n" if every else ""
        load = _moved("{0}=a[{1}];", before.intersection(every))
        store = _moved("a[{1}]={0};", written & needed)
        head = f"__attribute__((noinline)) int part{k}_{name}({parameters}, casadi_real* a)"
        yield head, f"{{\n{declared}{load}{''.join(statements[piece])}{store}  return 0;\n}}\n"
        before = needed


def _slots(statement: str) -> tuple[str, list[str]]:
    """The slot that a statement writes ("" for none), and those that it reads."""
    slots = _SLOT.findall(statement)
    return (slots[0], slots[1:]) if statement.startswith("  a") and slots else ("", slots)


def _moved(form: str, slots: Iterable[str]) -> str:
    return "".join(f"  {form.format(slot, int(slot[1:]))}\n" for slot in sorted(slots))
