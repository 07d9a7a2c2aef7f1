"""Ctrl-C and SIGTERM, held: never an exception in the middle of whatever runs, as that corrupts the
process in an FMU's own code and is lost in an import.

The first signal is counted, and asked for between two calls (`check`). A second one ends at once,
wherever the process is: processes that were started are ended and what is open is told (`add`);
then a command's process ends, and a caller from Python gets what it would have got without us,
KeyboardInterrupt as a rule.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from types import FrameType
from typing import Any

Action = Callable[[], object]
SIGNALS = (signal.SIGINT, signal.SIGTERM)
GRACE = 1.0
"""Seconds for the main thread to take a second signal; in an FMU's endless loop it never does."""

_actions: list[Action] = []
_count = 0
_holding = False


def came() -> bool:
    """Whether a signal has come since they are held."""
    return _count > 0


def check(time: float | None = None) -> None:
    """Raises Interrupted, at the simulated `time` (s), where a signal has come."""
    if _count:
        from hapticlink.orchestrator.base.faults import Interrupted  # signals are held before it

        raise Interrupted(time)


def add(action: Action) -> None:
    """A second signal does `action`, until it is removed."""
    _actions.append(action)


def remove(action: Action) -> None:
    with suppress(ValueError):
        _actions.remove(action)


@contextmanager
def held(end: Action | None = None, after: Any = None) -> Iterator[None]:
    """Within, signals are held; where they are held already, and in other threads than the main
    one, which get none, nothing changes. Those that were ignored before stay so.

    end: what a second signal does last, in place of what it would have done before. after: the
    handler of signals that come after, in place of the one before.
    """
    global _count, _holding
    if _holding or threading.current_thread() is not threading.main_thread():
        yield
        return
    found = {s: signal.getsignal(s) for s in SIGNALS}
    before = {s: h for s, h in found.items() if h not in (signal.SIG_IGN, None)}

    def take(number: int, frame: FrameType | None) -> None:
        global _count
        _count += 1
        if _count == 1:
            return
        _end(end)
        for each, handler in before.items():
            signal.signal(each, handler)
        signal.raise_signal(number)

    _count, _holding = 0, True
    for number in before:
        signal.signal(number, take)
    try:
        with _watched(end) if end and os.name == "posix" else nullcontext():
            yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler if after is None else after)
        _count, _holding = 0, False


def _end(last: Action | None) -> None:
    for action in reversed(_actions):
        with suppress(Exception):
            action()
    if last:
        last()


@contextmanager
def _watched(end: Action) -> Iterator[None]:
    """A thread beside, which ends the process where the main thread never gets to its handler."""
    told, tell = os.pipe()
    os.set_blocking(tell, False)
    before = signal.set_wakeup_fd(tell, warn_on_full_buffer=False)

    def watch() -> None:
        count = 0
        while number := os.read(told, 1):
            count += number[0] in SIGNALS
            if count > 1:
                time.sleep(GRACE)
                _end(end)
        os.close(told)

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(tell)


def end_process() -> None:
    """The end of a command at a second signal."""
    from hapticlink.orchestrator.base import temporary_folders  # signals are held before it

    with suppress(Exception):
        temporary_folders.clear(os.getpid())
    with suppress(OSError):
        os.write(2, b"hapticlink: interrupted twice: ended at once\n")
    os._exit(1)
