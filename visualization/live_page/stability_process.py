"""The stability verdict of the run behind a page, in a process of its own below the page's server:
neither the haptic loop nor the server waits for it.

The process stays, since loading the analysis takes longer than most verdicts. A newer question
ends what it computes; it ends with its standard input.
"""

from __future__ import annotations

import asyncio
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from hapticlink.orchestrator.base import interrupt, temporary_folders
from hapticlink.orchestrator.base.errors import Interrupted
from hapticlink.visualization.live_page.server_pipe import (
    ChildProcess,
    read_message,
    to_caller,
    write_message,
)

REST, LOOK = 0.3, 0.02
"""Times (s) for which nothing was changed before the verdict is computed, and between two looks for
an answer."""


class StabilityProcess:
    """Computes the verdict on the newest question, and hands its messages to `tell`."""

    def __init__(self, tell: Callable[[dict[str, Any]], None]) -> None:
        self._tell = tell
        self._asked: tuple[Any, ...] = ()
        self._number = 0
        self._link: ChildProcess | None = None
        self._answering: asyncio.Task[None] | None = None

    def ask(self, *asked: Any) -> None:
        """Compute the verdict on a run, instead of that which is being computed. asked: its packed
        scene, and the other arguments of `predict_stepwise`."""
        if asked == self._asked:
            return
        self._asked, self._number = asked, self._number + 1
        if self._answering:
            self._answering.cancel()
        self._tell({"type": "map", "verdict": "", "said": "computing", "why": ""})
        self._answering = asyncio.get_running_loop().create_task(self._answer(self._number))

    def end(self) -> None:
        """End the process."""
        if self._answering:
            self._answering.cancel()
        if self._link:
            self._link.end()

    async def _answer(self, number: int) -> None:
        await asyncio.sleep(REST)
        if not self._link or not self._link.alive:
            self._link = ChildProcess(__name__)
        self._link.send((number, *self._asked))
        while self._link.alive:
            for of, answer in self._link.received():
                if of == number and answer is None:
                    return
                if of == number:
                    self._tell({"type": "map"} | answer)
            await asyncio.sleep(LOOK)
        why = "not computed: its process has ended"
        self._tell({"type": "map", "verdict": "", "said": why, "why": ""})


def main() -> None:
    """Answer what is asked by the standard input: the number of the question with each answer, and
    with None behind the last."""
    out, questions = to_caller(), queue.SimpleQueue[Any]()
    signal.signal(signal.SIGINT, lambda *_: None)
    read_message(sys.stdin.buffer)  # the arguments, of which there are none

    def receive() -> None:
        while (question := read_message(sys.stdin.buffer)) is not None:
            if not interrupt.came():
                signal.raise_signal(signal.SIGINT)  # ends what is being computed, not this question
            questions.put(question)
        temporary_folders.clear(os.getpid())
        os._exit(1)

    threading.Thread(target=receive, daemon=True).start()
    from hapticlink.visualization.live_and_standalone.prediction import predict_stepwise
    from hapticlink.visualization.live_and_standalone.viewed_scene import unpack_scene

    while True:
        number, scene, *changes = questions.get()
        with suppress(Interrupted):
            for answer in predict_stepwise(unpack_scene(scene), *changes):
                write_message(out, (number, answer))
            write_message(out, (number, None))


if __name__ == "__main__":
    main()
