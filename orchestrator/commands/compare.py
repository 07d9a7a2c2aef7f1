"""`hapticlink compare`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.base.say import say
from hapticlink.orchestrator.commands.options import Out

Runs = Annotated[list[Path], Parameter(help="Folders of two or more runs.", negative="")]
WIDEST = 44
"""Characters of a column; longer texts are cut."""


def compare(runs: Runs, /, *, out: Out = None) -> int:
    """Tabulate what differs between runs: settings, how they ended, errors, forces, energies and
    timing. With OUT, draw their curves over each other, too."""
    from hapticlink.orchestrator.compare import numbers, overlay, settings
    from hapticlink.orchestrator.results import figures, folders
    from hapticlink.orchestrator.results.whole_run import named

    if len(runs) < 2:
        raise InputFault("compare takes two runs or more: `hapticlink report` is for one")
    found = named(runs)
    every = list(found.values())
    if other := settings.other_scenes(every):
        say(f"warning: {other}")
    rows = [numbers.Row(key, values) for key, values in settings.differing(every).items()]
    tables = {"Settings that differ": rows, **numbers.sections(every)}
    for title, told in tables.items():
        extra = numbers.apart(every) if title.startswith("How well") else []
        differing = [row for row in (*told, *extra) if len({*row.values}) > 1]
        if differing:
            say(f"\n{title}")
            say(*_aligned([("", tuple(found)), *differing]), sep="\n")
    same = sum(len({*row.values}) == 1 for told in tables.values() for row in told)
    say(f"\n{same} rows are the same for all; `hapticlink report` has them")
    if out:
        names = figures.save(overlay.figures(found), folders.ensure(out))
        say(f"{out}/: {', '.join(names)}")
    return 0


def _aligned(rows: Sequence[tuple[str, tuple[str, ...]]]) -> Iterator[str]:
    """Rows with columns of one width."""
    cells = [[label, *map(_cut, values)] for label, values in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for row in cells:
        yield "  " + "  ".join(map(str.ljust, row, widths)).rstrip()


def _cut(text: str) -> str:
    return text if len(text) <= WIDEST else f"{text[: WIDEST - 3]}..."
