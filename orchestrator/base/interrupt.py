"""Deferred handling of Ctrl-C and SIGTERM: no exception is raised in the middle of a call, as it
would corrupt the process within an FMU's own code, and be lost within an import.

The first signal is counted, and polled between two calls (`raise_if_interrupted`). A second one
ends the work at once, wherever the process is: the actions registered by `add` end child processes
and close what is open; then the process of a command ends, and a caller from Python gets what its
own handler raises, usually KeyboardInterrupt.
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
"""Time (s) for the main thread to handle a second signal; never enough in an endless loop."""
ENOUGH = 20.0
"""Time (s) for the actions of a second signal, some of which may wait for ever for what the main
thread holds."""

_actions: list[Action] = []
_count = 0
_holding = False


def came() -> bool:
    """Whether a signal has arrived since signals are deferred."""
    return _count > 0


def raise_if_interrupted(time: float | None = None) -> None:
    """Raises Interrupted, with the simulated `time` (s), if a signal has arrived."""
    if _count:
        from hapticlink.orchestrator.base.errors import Interrupted  # loaded within `defer_signals`

        raise Interrupted(time)


@contextmanager
def at_once() -> Iterator[None]:
    """Context of a call that waits for a person, which a signal ends: raises Interrupted there. Of
    the main thread, with signals deferred."""

    def take(*_: object) -> None:
        global _count
        _count += 1
        raise_if_interrupted()

    raise_if_interrupted()
    handled = (number for number in SIGNALS if callable(signal.getsignal(number)))
    deferred = {number: signal.signal(number, take) for number in handled}
    try:
        yield
    finally:
        for number, handler in deferred.items():
            signal.signal(number, handler)


def add(action: Action) -> None:
    """Registers an action for a second signal, until it is removed."""
    _actions.append(action)


def remove(action: Action) -> None:
    """Removes an action; does nothing if it is not registered."""
    with suppress(ValueError):
        _actions.remove(action)


@contextmanager
def defer_signals(end: Action | None = None, after: Any = None) -> Iterator[None]:
    """Defers signals within the context. Nested contexts and threads other than the main one, which
    receive no signals, change nothing. Signals that were ignored before stay ignored.

    end: last action of a second signal, in place of the previous handler. after: handler that is
    installed at the end, in place of the previous one.
    """
    global _count, _holding
    if _holding or threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {s: signal.getsignal(s) for s in SIGNALS}
    before = {s: h for s, h in handlers.items() if h not in (signal.SIG_IGN, None)}

    def take(number: int, frame: FrameType | None) -> None:
        global _count
        _count += 1
        if _count == 1:
            return
        _end(end)
        for which, handler in before.items():
            signal.signal(which, handler)
        signal.raise_signal(number)

    _count, _holding = 0, True
    for number in before:
        signal.signal(number, take)
    try:
        with _watch(end) if end and os.name == "posix" else nullcontext():
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
def _watch(end: Action) -> Iterator[None]:
    """A watchdog thread that ends the process where the main thread does not get to its handler."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    before = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)

    def watch() -> None:
        count = 0
        with suppress(OSError):  # an FMU may have closed either end
            while number := os.read(reading, 1):
                count += number[0] in SIGNALS
                if count > 1:
                    time.sleep(GRACE)
                    last = threading.Timer(ENOUGH, os._exit, (1,))
                    last.daemon = True
                    last.start()
                    _end(end)
            os.close(reading)

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        with suppress(OSError):
            os.close(writing)


def end_process() -> None:
    """Ends the process of a command at a second signal; removes its unfinished files and temporary
    folders."""
    from hapticlink.fmus import atomic_file  # loaded within `defer_signals`
    from hapticlink.orchestrator.base import temporary_folders

    with suppress(Exception):
        atomic_file.remove_unfinished()
    with suppress(Exception):
        temporary_folders.clear(os.getpid())
    with suppress(OSError):
        os.write(2, b"hapticlink: interrupted twice: ended at once\n")
    os._exit(1)
