"""`hapticlink compare`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from hapticlink.commands.options import Json, Out, tell
from hapticlink.orchestrator.base.faults import InputFault

if TYPE_CHECKING:
    from hapticlink.visualization.compare.numbers import Row

Runs = Annotated[list[Path], Parameter(help="Folders of two or more runs.", negative="")]
WIDEST = 44
"""Characters of a column; longer texts are cut."""


def compare(runs: Runs, /, *, out: Out = None, json: Json = False) -> int:
    """Tabulate what differs between runs: settings, how they ended, errors, forces, energies and
    timing. With OUT, draw their curves over each other, too.

    For example:

        hapticlink compare runs/on runs/off
        hapticlink compare runs/on runs/off --out figures
        hapticlink compare runs/on runs/off --json
    """
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.named_runs import named
    from hapticlink.visualization.compare import numbers, overlay, settings
    from hapticlink.visualization.figures import run_figures

    if len(runs) < 2:
        raise InputFault("compare takes two runs or more: `hapticlink report` is for one")
    run_by_name = named(runs)
    every = list(run_by_name.values())
    rows = [numbers.Row(key, values) for key, values in settings.differing(every).items()]
    tables = {"Settings that differ": rows, **numbers.sections(every)}
    lines = [*_lines(list(run_by_name), tables)]
    if other := settings.other_scenes(every):
        lines.insert(0, f"warning: {other}")
    if out:
        names = run_figures.save(overlay.figures(run_by_name), folders.ensure(out))
        lines.append(f"{out}/: {', '.join(names)}")
    by_run = {
        name: {title: {row.label: row.values[i] for row in told} for title, told in tables.items()}
        for i, name in enumerate(run_by_name)
    }
    tell(lines, {"note": other, "runs": by_run}, False, json)
    return 0


def _lines(names: Sequence[str], tables: Mapping[str, Sequence[Row]]) -> Iterator[str]:
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
    cells = [[label, *map(_cut, values)] for label, values in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for row in cells:
        yield "  " + "  ".join(map(str.ljust, row, widths)).rstrip()


def _cut(text: str) -> str:
    return text if len(text) <= WIDEST else f"{text[: WIDEST - 3]}..."
