"""Text for a terminal, which acts on control characters in the strings of an FMU or a scene; and
tables with columns of one width."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from textwrap import wrap
from typing import TextIO

WIDEST = 44
"""Characters of a column; longer texts have several lines."""


def printable(text: str) -> str:
    """`text` with escapes (\\x1b) of the characters that are neither printable nor end a line."""
    return "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text
    )


def say(*texts: object, sep: str = " ", file: TextIO | None = None) -> None:
    """Print `texts`, printable."""
    print(printable(sep.join(map(str, texts))), file=file)


def align_columns(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """The lines of a table; all rows have as many texts as the first."""
    cells = [[wrap(text, WIDEST) or [""] for text in row] for row in rows]
    columns = zip(*cells, strict=True)
    widths = [max(len(line) for cell in column for line in cell) for column in columns]
    for row in cells:
        for line in zip_longest(*row, fillvalue=""):
            yield "  ".join(map(str.ljust, line, widths)).rstrip()
