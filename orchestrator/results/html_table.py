"""A table as a notebook shows it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from itertools import islice
from typing import Any

MOST = 60
"""Rows that are shown."""


def html_table(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """An HTML table of `rows`, of which more than MOST are counted; numbers have four digits."""
    rest = iter(rows)
    body = "".join(_row("td", map(_cell, row)) for row in islice(rest, MOST))
    further = sum(1 for _ in rest)
    told = f"<caption>{further} further rows</caption>" if further else ""
    return f"<table>{told}<thead>{_row('th', columns)}</thead><tbody>{body}</tbody></table>"


def _row(tag: str, cells: Iterable[str]) -> str:
    return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
