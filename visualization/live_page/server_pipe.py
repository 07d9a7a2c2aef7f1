"""Pipes of pickled messages between haptic loop, page server and stability process, on which none
waits for another."""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from contextlib import suppress
from typing import IO, Any

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.fmi.worker_process import OWN_GROUP

MAX_WAITING = 256
"""Messages that wait in either direction; of older ones frames are dropped."""
ENDING, WAIT = 3.0, 0.005
"""Times (s) that a process may take to end, and between two looks for its first message."""


class Pipe:
    """Messages to and from another process. alive: whether that one still sends."""

    def __init__(self, incoming: IO[bytes], outgoing: IO[bytes]) -> None:
        self._incoming, self._outgoing, self.alive = incoming, outgoing, True
        self._sent: queue.Queue[bytes | None] = queue.Queue(MAX_WAITING)
        self._received: deque[Any] = deque(maxlen=MAX_WAITING)
        threading.Thread(target=self._receive, daemon=True).start()
        threading.Thread(target=self._send, daemon=True).start()

    def send(self, message: Any, frame: bool = False) -> None:
        """Send a message; a frame is dropped where the other is behind."""
        if not (frame and self._sent.qsize() > MAX_WAITING // 8):
            with suppress(queue.Full):
                self._sent.put_nowait(pickle.dumps(message))

    def received(self) -> list[Any]:
        """The messages that have arrived since the last call."""
        return [self._received.popleft() for _ in range(len(self._received))]

    def close(self) -> None:
        """Send nothing more, which ends the other process."""
        with suppress(queue.Empty):
            while True:
                self._sent.get_nowait()
        self._sent.put(None)

    def _receive(self) -> None:
        while (message := read_message(self._incoming)) is not None:
            self._received.append(message)
        self.alive = False

    def _send(self) -> None:
        with suppress(OSError, ValueError):
            while (message := self._sent.get()) is not None:
                self._outgoing.write(message)
                self._outgoing.flush()
        with suppress(OSError):
            self._outgoing.close()


class ChildProcess(Pipe):
    """A process of this package's `module`, whose first message are the `arguments`: no other
    process can read them there. A context manager that ends it."""

    def __init__(self, module: str, *arguments: Any) -> None:
        command = [sys.executable, "-P", "-m", module]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, **OWN_GROUP
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        super().__init__(self._process.stdout, self._process.stdin)
        self.send(arguments)
        interrupt.add(self._process.kill)

    def first(self) -> Any:
        """The first message of the process, once it is there; None where it ended without one."""
        while not self._received and self.alive:
            time.sleep(WAIT)
        return self._received.popleft() if self._received else None

    def __enter__(self) -> ChildProcess:
        return self

    def __exit__(self, *error: object) -> None:
        self.end()

    def end(self) -> None:
        """End the process."""
        self.close()
        try:
            self._process.wait(ENDING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        interrupt.remove(self._process.kill)


def to_caller() -> IO[bytes]:
    """The standard output for messages alone, in a ChildProcess: whatever prints goes to the
    standard error. Ctrl-C in the terminal is left to the caller."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return out


def write_message(stream: IO[bytes], message: Any) -> None:
    """Write a message to a stream, for `read_message`."""
    pickle.dump(message, stream)
    stream.flush()


def read_message(stream: IO[bytes]) -> Any:
    """The next message of a stream, None at its end."""
    try:
        return pickle.load(stream)
    except Exception:  # the end, or what is left of a message cut in two
        return None
