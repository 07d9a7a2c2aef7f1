"""The tables of a comparison as text: the rows in which runs differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from textwrap import wrap

from hapticlink.visualization.compare.numbers import Row

WIDEST = 44
"""Characters of a column; longer texts have several lines."""


def lines(names: Sequence[str], tables: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """The rows in which the runs differ, and how many there are in which they do not."""
    for title, rows in tables.items():
        if differing := [row for row in rows if len({*row.values}) > 1]:
            yield title
            yield from _aligned([("", tuple(names)), *differing])
            yield ""
    same = sum(len({*row.values}) == 1 for rows in tables.values() for row in rows)
    yield f"{same} rows are the same for all: `hapticlink report` has them"


def _aligned(rows: Sequence[tuple[str, tuple[str, ...]]]) -> Iterator[str]:
    """Rows with columns of one width."""
    cells = [[wrap(text, WIDEST) or [""] for text in (label, *values)] for label, values in rows]
    columns = zip(*cells, strict=True)
    widths = [max(len(line) for cell in column for line in cell) for column in columns]
    for row in cells:
        for line in zip_longest(*row, fillvalue=""):
            yield "  " + "  ".join(map(str.ljust, line, widths)).rstrip()
