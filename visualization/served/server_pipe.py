"""The pipe between the haptic loop and the server; neither waits for the other on it."""

from __future__ import annotations

import pickle
import queue
import subprocess
import sys
import threading
from collections import deque
from contextlib import suppress
from typing import IO, Any

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.fmi.worker_process import OWN_GROUP

MAX_WAITING = 256
"""Messages that wait in either direction; of older ones frames are dropped."""
ENDING = 3.0
"""Seconds that the server may take to end."""


class Link:
    """The server's process, seen from the haptic loop. A context manager that ends it."""

    def __init__(self, module: str, *arguments: str) -> None:
        command = [sys.executable, "-P", "-m", module]  # arguments would be for all to read
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, **OWN_GROUP
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._requests, self._answers = self._process.stdin, self._process.stdout
        with suppress(OSError):  # it has ended, which `first` tells
            pickle.dump(arguments, self._requests)
            self._requests.flush()
        self._sent: queue.Queue[bytes | None] = queue.Queue(MAX_WAITING)
        self._received: deque[Any] = deque(maxlen=MAX_WAITING)
        self.first: Any = read(self._answers)
        """The first message of the server, None where it ended without one."""
        threading.Thread(target=self._receive, daemon=True).start()
        threading.Thread(target=self._send, daemon=True).start()
        interrupt.add(self._process.kill)

    @property
    def alive(self) -> bool:
        """Whether the server runs."""
        return self._process.poll() is None

    def send(self, message: Any, frame: bool = False) -> None:
        """Send a message; a frame is dropped where the server is behind."""
        if not (frame and self._sent.qsize() > MAX_WAITING // 8):
            with suppress(queue.Full):
                self._sent.put_nowait(pickle.dumps(message))

    def received(self) -> list[Any]:
        """The messages that have arrived since the last call."""
        return [self._received.popleft() for _ in range(len(self._received))]

    def _receive(self) -> None:
        while (message := read(self._answers)) is not None:
            self._received.append(message)

    def _send(self) -> None:
        with suppress(OSError, ValueError):
            while (message := self._sent.get()) is not None:
                self._requests.write(message)
                self._requests.flush()
        with suppress(OSError):
            self._requests.close()

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *error: object) -> None:
        while True:
            with suppress(queue.Empty):
                self._sent.get_nowait()
                continue
            break
        self._sent.put(None)
        try:
            self._process.wait(ENDING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        interrupt.remove(self._process.kill)


def read(stream: IO[bytes]) -> Any:
    """The next message of a stream, None at its end."""
    try:
        return pickle.load(stream)
    except Exception:  # the end, or what is left of a message cut in two
        return None
