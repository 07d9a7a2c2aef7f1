"""A progress bar on stderr, only where somebody sees it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress(title: str, duration: float) -> Iterator[Callable[[float], None] | None]:
    """Gives a function that is told the simulated time (s), None where stderr is no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[at]}"))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task(title, total=duration, at="building")

        def tell(time: float) -> None:
            bar.update(task, completed=time, at=f"{time:.2f} of {duration:g} s")

        yield tell
