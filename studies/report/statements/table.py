"""The table of all statements, as page and as CSV."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from studies.report.statements.statement import Statement

HEAD = """# All statements of the report

Every equation, figure, table, gain and claim of the traineeship report *Haptic manipulation of
virtual linkages with closed loops*, in other words than its own, compared with what was found. The
numbers are computed by `hapticlink reproduce` from the runs of the commands beside them, whose
folders have the settings (`run.json`) and signals (`haptics.csv`, `graphics.csv`), and by the tests
beside them. What is found *by the test* agrees as long as that test passes. *As stated* and
*idealised* are the two systems of [the figures](README.md). As CSV:
[statements.csv](statements.csv).
"""
HEADINGS = {
    "differs": "Differs",
    "misprint": "Differs in print alone",
    "agrees": "Agrees",
    "cannot be compared": "Cannot be compared",
}


def write(folder: Path, statements: Sequence[Statement]) -> str:
    """Write statements.md and statements.csv to `folder`, those that differ first, each kind in the
    report's order. Returns the numbers of each verdict in words."""
    kinds = {kind: [s for s in statements if _kind(s) == kind] for kind in HEADINGS}
    parts = [HEAD]
    for kind, heading in HEADINGS.items():
        parts.append(
            f"## {heading} ({len(kinds[kind])})\n\n"
            "| where | statement | found | command |\n|---|---|---|---|"
        )
        parts += [*map(_row, kinds[kind]), ""]
    (folder / "statements.md").write_text("\n".join(parts), encoding="utf-8")
    with (folder / "statements.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("place", "statement", "verdict", "in print alone", "number", "command"))
        for s in (s for kind in kinds.values() for s in kind):
            alone = "yes" if s.misprint else ""
            writer.writerow((s.place, s.text, s.verdict, alone, s.number, s.command))
    differ, misprints, agree, left = (len(kind) for kind in kinds.values())
    return (
        f"{len(statements)} in all, of which {differ} differ, {misprints} are misprints, {agree} "
        f"agree and {left} cannot be compared"
    )


def _kind(s: Statement) -> str:
    return "misprint" if s.misprint else s.verdict


def _row(s: Statement) -> str:
    shown = s.command if s.command == "-" else "<br>".join(f"`{c}`" for c in s.command.split("; "))
    return (
        "| " + " | ".join(t.replace("|", "\\|") for t in (s.place, s.text, s.number, shown)) + " |"
    )
