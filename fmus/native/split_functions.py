"""Splits long C functions of straight-line code into pieces that compile in linear time.

The time to compile a function grows faster than its length, since its registers are allocated in
quadratic time (N-four-bar of 40 windows, 220,000 statements: 37 s as three functions, 13 s in
pieces). A piece is a function that is not inlined; the slots of CasADi's work vector that it shares
with other pieces are in an array `a`, all others are its local variables. A shared slot is read
right before its first use and written right after its last value: read or written all at once,
slots are more than registers, move to the stack a second time, and take 25 % longer to run. Every
statement stays as it is, so that the results are the same, bit for bit.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from itertools import islice

MAX_STATEMENTS = 30_000
"""Statements that stay one function, which compiles in 3 s."""
PIECE_STATEMENTS = 500
FILE_PIECES = 40
"""Pieces in a file."""

_FUNCTION = re.compile(
    r"^static int (\w+)\(([^)]*)\) \{\n((?:  casadi_real [a\d, ]+;\n)+)(.*?)^  return 0;\n\}\n",
    re.MULTILINE | re.DOTALL,
)
_SLOT = re.compile(r"\ba\d+\b")
_HELPER = re.compile(r"^(?=(?:casadi_real|casadi_int|void) casadi_)", re.MULTILINE)


def split_functions(text: str) -> tuple[str, Iterable[str]]:
    """The C text with each long function replaced by calls of its pieces, and the files of pieces,
    each made when it is asked for, so that the ones before can be compiled meanwhile; () where no
    function is long. `text` is CasADi's, with static functions."""
    long: list[tuple[list[str], list[str]]] = []  # heads of the pieces, and statements

    def shortened(match: re.Match[str]) -> str:
        name, parameters, declared, body = match.groups()
        statements = body.splitlines(keepends=True)
        if len(statements) <= MAX_STATEMENTS:
            return match[0]
        heads = [
            f"__attribute__((noinline)) int part{k}_{name}({parameters}, casadi_real* a)"
            for k in range(-(-len(statements) // PIECE_STATEMENTS))
        ]
        long.append((heads, statements))
        size = 1 + max(int(slot[1:]) for slot in _SLOT.findall(declared))
        calls = (f"  if (part{k}_{name}(arg, res, iw, w, mem, a)) return 1;\n"
                 for k in range(len(heads)))  # fmt: skip
        return (
            f"{''.join(f'{head};' for head in heads)}\nstatic int {name}({parameters}) {{\n"
            f"  casadi_real a[{size}];\n{''.join(calls)}  return 0;\n}}\n"
        )

    main = _FUNCTION.sub(shortened, text)
    if not long:
        return main, ()
    whole = hashlib.sha256(text.encode()).hexdigest()
    main = f"/* Pieces of {whole}. */\n{_HELPER.sub('static ', main)}"  # it is part of every file
    return main, _files(main, (piece for function in long for piece in _pieces(*function)))


def _files(main: str, pieces: Iterator[str]) -> Iterator[str]:
    while several := [*islice(pieces, FILE_PIECES)]:
        yield main + "".join(several)


def _pieces(heads: list[str], statements: list[str]) -> Iterator[str]:
    """The pieces of a function, with their heads."""
    slots = [_slots(statement) for statement in statements]
    bounds = [slice(k, k + PIECE_STATEMENTS) for k in range(0, len(statements), PIECE_STATEMENTS)]
    after: list[set[str]] = []  # by piece: slots whose values later pieces read
    live: set[str] = set()
    for piece in reversed(bounds):
        after.append(live.copy())
        for written, read in reversed(slots[piece]):
            live.discard(written)
            live.update(read)
    before: set[str] = set()
    for head, piece, needed in zip(heads, bounds, reversed(after), strict=True):
        last = {written: i for i, (written, _) in enumerate(slots[piece])}
        body: list[str] = []
        local: set[str] = set()
        for i, (statement, (written, read)) in enumerate(
            zip(statements[piece], slots[piece], strict=True)
        ):
            for slot in read:
                if slot in before and slot not in local:
                    body.append(f"  {slot}=a[{int(slot[1:])}];\n")
                    local.add(slot)
            body.append(statement)
            if written in needed and last[written] == i:
                body.append(f"  a[{int(written[1:])}]={written};\n")
            local.update(read, {written} - {""})
        declared = f"  casadi_real {', '.join(sorted(local))};\n" if local else ""
        yield f"{head} {{\n{declared}{''.join(body)}  return 0;\n}}\n"
        before = needed


def _slots(statement: str) -> tuple[str, list[str]]:
    """The slot that a statement writes ("" for none), and those that it reads."""
    slots = _SLOT.findall(statement)
    return (slots[0], slots[1:]) if statement.startswith("  a") and slots else ("", slots)
