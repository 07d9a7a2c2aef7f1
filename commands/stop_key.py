"""A key that ends a run, as the emergency stop of a board."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


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
