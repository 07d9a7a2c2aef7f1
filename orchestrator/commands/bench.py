"""`hapticlink bench`: needs a checkout, where benchmarks/ is."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from hapticlink.orchestrator.commands.options import Out
from hapticlink.orchestrator.faults import InputFault


def bench(
    what: Literal["mechanism"],
    /,
    *,
    out: Out = None,
    quick: Annotated[bool, Parameter(negative="", help="Fewer steps, sizes and rounds.")] = False,
) -> int:
    """Run time against error of the mechanism, with the multibody codes that are installed.

    Writes a page, CSV tables and figures to OUT (default results/mechanism). Interrupted, it goes
    on where it stopped.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    root = checkout()
    sys.path.insert(0, str(root))
    # By name: the package's own checks never see what is not in it.
    mechanism_bench = importlib.import_module("benchmarks.run").mechanism_bench
    folder = out or root / "results" / what
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(what)

        def told(text: str, done: int, total: int) -> None:
            bar.update(task, description=text, completed=done, total=total)

        command = f"hapticlink bench {what}{' --quick' * quick}"
        mechanism_bench(folder, quick, told, command)
    print(f"{folder}/: README.md, table.csv, error-against-run-time.png, growth.png")
    return 0


def checkout() -> Path:
    """The project's folder. Raises InputFault where only the package is installed."""
    import hapticlink.components

    root = Path(next(iter(hapticlink.components.__path__))).resolve().parent
    if not (root / "benchmarks" / "run.py").exists():
        raise InputFault(
            "`bench`: the benchmarks are not part of the installed package; "
            "clone the project and install it with `pip install -e .[peers]`"
        )
    return root
