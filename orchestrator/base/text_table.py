"""Rows of texts with columns of one width, as the terminal shows them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from textwrap import wrap

WIDEST = 44
"""Characters of a column; longer texts have several lines."""


def aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """The lines of a table; all rows have as many texts as the first."""
    cells = [[wrap(text, WIDEST) or [""] for text in row] for row in rows]
    columns = zip(*cells, strict=True)
    widths = [max(len(line) for cell in column for line in cell) for column in columns]
    for row in cells:
        for line in zip_longest(*row, fillvalue=""):
            yield "  ".join(map(str.ljust, line, widths)).rstrip()
