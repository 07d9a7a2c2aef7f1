"""The tables of a comparison as text: the rows in which runs differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from hapticlink.orchestrator.base.terminal_output import aligned
from hapticlink.visualization.compare.numbers import Row


def lines(names: Sequence[str], tables: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """The rows in which the runs differ, and how many there are in which they do not."""
    for title, rows in tables.items():
        if differing := [row for row in rows if len({*row.values}) > 1]:
            yield title
            table = [("", *names), *((row.label, *row.values) for row in differing)]
            yield from (f"  {line}" for line in aligned(table))
            yield ""
    same = sum(len({*row.values}) == 1 for rows in tables.values() for row in rows)
    yield f"{same} rows are the same for all: `hapticlink report` has them"
