"""Keys of a run with a board: any of them ends it, and Enter says that the handle is in place."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.terminal_output import say


@contextmanager
def stop_key() -> Iterator[Callable[[], bool] | None]:
    """Context in which keys of the terminal are read as they are pressed: asks whether one was.
    None where there is no terminal."""
    if not sys.stdin or not sys.stdin.isatty():
        yield None
    elif os.name == "nt":
        import msvcrt

        yield msvcrt.kbhit  # type: ignore[attr-defined]
    else:
        import select
        import termios
        import tty

        before = termios.tcgetattr(sys.stdin)
        tty.setcbreak(sys.stdin, termios.TCSANOW)
        try:
            yield lambda: bool(select.select([sys.stdin], [], [], 0)[0])
        finally:
            termios.tcsetattr(sys.stdin, termios.TCSAFLUSH, before)


def read_line() -> str:
    """A line that somebody types, "" where the input has ended; Ctrl-C raises Interrupted."""
    with interrupt.at_once():
        return sys.stdin.readline()


def wait_for_enter(what: str) -> None:
    """Say what to do, and wait until Enter says that it is done; without a terminal go on."""
    if sys.stdin and sys.stdin.isatty():
        say(f"{what}, then press Enter", file=sys.stderr)
        read_line()
