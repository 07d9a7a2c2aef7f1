"""Ctrl-C and SIGTERM as a flag that the loop reads between events, so an FMU's own Python code
is never cut in the middle of a step."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Flag:
    """True once a signal has come."""

    raised = False

    def __bool__(self) -> bool:
        return self.raised


came = Flag()
"""A signal before a run: told by KeyboardInterrupt, and kept, as an import that catches everything
may lose that."""


def remember(number: int, frame: FrameType | None) -> None:
    came.raised = True
    raise KeyboardInterrupt


@contextmanager
def watch() -> Iterator[Flag]:
    """Within, the first signal raises the flag; a second one acts as it did before."""
    flag = Flag()
    flag.raised = bool(came)
    if threading.current_thread() is not threading.main_thread():
        yield flag  # only the main thread gets signals
        return
    before = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def raise_flag(number: int, frame: FrameType | None) -> None:
        flag.raised = True
        restore()

    for number in before:
        signal.signal(number, raise_flag)
    try:
        yield flag
    finally:
        restore()
