"""A progress bar on stderr if that is a terminal, else a line at the start of what is long."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from hapticlink.fmus.durations import record_duration
from hapticlink.orchestrator.base.errors import Fault, Interrupted
from hapticlink.orchestrator.base.terminal_output import printable, say

SHORT = 2.0
"""Duration (s) below which nothing is said of what is begun."""


@contextmanager
def count_runs(title: str, hidden: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Gives a function to be called with the numbers of finished and of all runs."""
    with bar(title, hidden) as show:
        yield lambda done, of: show(done, of, f"{done} of {of} runs") if show else None


@contextmanager
def runs(title: str, hidden: bool = False) -> Iterator[Callable[[int, int], None]]:
    """The same for what may be long, as `steps`."""
    with steps(title, hidden) as show:
        yield lambda done, of: show(f"{done} of {of} runs", done, of)


@contextmanager
def steps(title: str, hidden: bool = False) -> Iterator[Callable[[str, int, int], None]]:
    """Gives a function to be called with what is done, and the numbers of finished and of all
    steps. Where stderr is no terminal, a line tells at the start how long it took before. Raises
    Interrupted with what was done."""
    begun = ""

    def tell(what: str, done: int, of: int) -> None:
        nonlocal begun
        begun = f"({what}; {done} of {of} steps were done)"
        if show:
            show(done, of, what)

    with record_duration(title) as took, bar(title, hidden) as show:
        if not (hidden or show):
            _tell(title, took)
        try:
            yield tell
        except Interrupted:
            raise Interrupted(when=begun) from None


@contextmanager
def progress(
    title: str, end: float, hidden: bool = False
) -> Iterator[Callable[[float], None] | None]:
    """Gives a function to be called with the simulated time (s), until `end`; None if stderr is no
    terminal."""
    with bar(title, hidden) as show:
        yield ((lambda time: show(time, end, f"{time:.2f} of {end:g} s")) if show else None)


@contextmanager
def time_command(
    command: str, guess: str = "not known yet", hidden: bool = False
) -> Iterator[None]:
    """Prints before a long command how many minutes it took at most on this machine, or `guess`,
    and records how many it takes. Raises Fault where it is interrupted."""
    with record_duration(command) as took:
        if took is not None:
            guess = f"up to {took / 60:.1f} minutes here, less if partly finished before"
        if not hidden:
            say(f"{command}: duration {guess}", file=sys.stderr)
        try:
            yield
        except Interrupted:
            raise Fault("interrupted; finished runs are kept") from None


@contextmanager
def waiting(what: str, hidden: bool = False) -> Iterator[None]:
    """Says what is being done, for as long as it takes, and how long it took before, where nothing
    can be counted; once at the start where stderr is no terminal. Raises Interrupted with it."""
    with record_duration(what) as took, ExitStack() as stack:
        if not hidden and sys.stderr.isatty():
            from rich.console import Console
            from rich.markup import escape

            said = escape(printable(_say_duration(what, took)))
            stack.enter_context(Console(stderr=True).status(said))
        elif not hidden:
            _tell(what, took)
        try:
            yield
        except Interrupted:
            raise Interrupted(when=f"({what})") from None


def _say_duration(what: str, took: float | None) -> str:
    return what if took is None else f"{what}, up to {took:.0f} s before"


def _tell(what: str, took: float | None) -> None:
    """Prints what is begun on stderr, unless it is known to take less than SHORT."""
    if took is None or took >= SHORT:
        say(_say_duration(what, took), file=sys.stderr)


@contextmanager
def bar(title: str, hidden: bool = False) -> Iterator[Callable[[float, float, str], None] | None]:
    """Gives a function to be called with what is finished, with all, and with a text; None where
    nothing is shown."""
    if hidden or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    said = TextColumn("{task.description}", markup=False)
    columns = (said, BarColumn(), TextColumn("{task.fields[at]}"))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as shown:
        task = shown.add_task(printable(title), total=None, at="building")

        def show(completed: float, total: float, at: str) -> None:
            shown.update(task, completed=completed, total=total, at=at)

        yield show
