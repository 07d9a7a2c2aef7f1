"""A progress bar on stderr, if that is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from hapticlink.orchestrator.base.say import printable


@contextmanager
def counted(title: str, hidden: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Gives a function to be called with the numbers of finished and of all runs."""
    with _bar(title, hidden) as show:
        yield lambda done, of: show(done, of, f"{done} of {of} runs") if show else None


@contextmanager
def progress(
    title: str, duration: float, hidden: bool = False
) -> Iterator[Callable[[float], None] | None]:
    """Gives a function to be called with the simulated time (s); None if stderr is no terminal."""
    with _bar(title, hidden) as show:
        yield (
            (lambda time: show(time, duration, f"{time:.2f} of {duration:g} s")) if show else None
        )


@contextmanager
def waiting(what: str, hidden: bool = False) -> Iterator[None]:
    """Says what is being done, for as long as it takes, where nothing can be counted."""
    if hidden or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.markup import escape

    with Console(stderr=True).status(escape(printable(what))):
        yield


@contextmanager
def _bar(title: str, hidden: bool) -> Iterator[Callable[[float, float, str], None] | None]:
    if hidden or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    said = TextColumn("{task.description}", markup=False)
    columns = (said, BarColumn(), TextColumn("{task.fields[at]}"))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task(printable(title), total=None, at="building")

        def show(completed: float, total: float, at: str) -> None:
            bar.update(task, completed=completed, total=total, at=at)

        yield show
