"""The table of all statements, as page and as CSV."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

from studies.report.statements.record import Statement, Verdict

HEAD = """# All statements of the report

Every equation, figure, table, gain and claim of the traineeship report *Haptic manipulation of
virtual linkages with closed loops*, in other words than its own, compared with what was found. The
numbers are computed by `hapticlink reproduce`; the command beside each shows it. *As stated* and
*idealised* are the two systems of [the figures](README.md). As CSV: [statements.csv](statements.csv).
"""
ORDER: tuple[Verdict, ...] = ("differs", "agrees", "cannot be compared")
assert {*ORDER} == {*get_args(Verdict)}


def write(folder: Path, statements: Sequence[Statement]) -> str:
    """Write statements.md and statements.csv to `folder`, those that differ first, each verdict in
    the report's order. Returns the numbers of each verdict in words."""
    counted = Counter(s.verdict for s in statements)
    parts = [HEAD]
    for verdict in ORDER:
        parts.append(
            f"## {verdict.capitalize()} ({counted[verdict]})\n\n"
            "| where | statement | found | command |\n|---|---|---|---|"
        )
        parts += [_row(s) for s in statements if s.verdict == verdict]
        parts.append("")
    (folder / "statements.md").write_text("\n".join(parts), encoding="utf-8")
    with (folder / "statements.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("place", "statement", "verdict", "number", "command"))
        for verdict in ORDER:
            for s in statements:
                if s.verdict == verdict:
                    writer.writerow((s.place, s.text, s.verdict, s.number, s.command))
    numbers = [f"{counted[v]} {v}" if v != "differs" else f"{counted[v]} differ" for v in ORDER]
    return f"{len(statements)} ({', '.join(numbers)})".replace("agrees", "agree")


def _row(s: Statement) -> str:
    shown = s.command if s.command == "-" else "<br>".join(f"`{c}`" for c in s.command.split("; "))
    return (
        "| " + " | ".join(t.replace("|", "\\|") for t in (s.place, s.text, s.number, shown)) + " |"
    )
