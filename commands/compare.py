from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands.options import Json, Out, print_result
from hapticlink.orchestrator.base.errors import InputFault

Runs = Annotated[list[Path], Parameter(help="Folders of two or more runs.", negative="")]


def compare(runs: Runs, /, *, out: Out = None, json: Json = False) -> int:
    """Tabulate what differs between runs: settings, how they ended, errors, forces, energies and
    timing. With OUT, draw their curves over each other, too.

    For example:

        hapticlink compare runs/on runs/off
        hapticlink compare runs/on runs/off --out figures
        hapticlink compare runs/on runs/off --json
    """
    import hapticlink as hl
    from hapticlink.orchestrator.results import folders
    from hapticlink.visualization import figure_files

    if len(runs) < 2:
        raise InputFault("compare takes two runs or more: `hapticlink report` is for one")
    comparison = hl.compare(runs)
    lines = [str(comparison)]
    if out:
        names = figure_files.save(comparison.figures(), folders.ensure(out))
        lines.append(f"{out}/: {', '.join(names)}")
    print_result(lines, {"note": comparison.note, "runs": comparison.values()}, False, json)
    return 0
