"""The stability verdict of the run behind a page, in a process of its own below the page's server:
neither the haptic loop nor the server waits for it.

The process gets two pickles by its standard input, the end of which ends it: the scene, and what
was changed of it. Its answer is JSON (`prediction.predicted`).
"""

from __future__ import annotations

import asyncio
import json
import os
import pickle
import sys
import threading
from asyncio.subprocess import PIPE
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.fmi.worker_process import OWN_GROUP

REST = 1.0
"""Time (s) for which nothing was changed before the verdict is computed."""
ENDING = 1.0
"""Time (s) that the process may take to end."""
NICE = 10
"""Its priority: all others get ten times its share; with 19 it would not end beside busy ones."""


class StabilityProcess:
    """Computes the verdict on the newest request, and hands its messages to `tell`."""

    def __init__(self, tell: Callable[[dict[str, Any]], None]) -> None:
        self._tell, self._asked = tell, b""
        self._answering: asyncio.Task[None] | None = None

    def ask(self, asked: bytes) -> None:
        """Compute the verdict on a run, instead of that which is being computed."""
        if asked == self._asked:
            return
        self._asked = asked
        if self._answering:
            self._answering.cancel()
        self._tell({"type": "map", "verdict": "", "said": "computing", "why": ""})
        self._answering = asyncio.get_running_loop().create_task(self._answer(asked))

    async def end(self) -> None:
        """End the computation."""
        if self._answering:
            self._answering.cancel()
            await asyncio.wait([self._answering])

    async def _answer(self, asked: bytes) -> None:
        await asyncio.sleep(REST)
        command = (sys.executable, "-P", "-m", __name__)
        process = await asyncio.create_subprocess_exec(
            *command, stdin=PIPE, stdout=PIPE, **OWN_GROUP
        )
        assert process.stdin
        assert process.stdout
        try:
            process.stdin.write(asked)
            answer = await process.stdout.read()
        finally:
            process.stdin.close()
            try:
                await asyncio.wait_for(process.wait(), ENDING)
            except TimeoutError:
                process.kill()
        if not answer:
            why = f"not computed: its process ended with exit status {process.returncode}"
            answer = json.dumps({"verdict": "", "said": why, "why": ""}).encode()
        self._tell({"type": "map"} | json.loads(answer))


def main() -> None:
    """Answer what is asked by the standard input."""
    _yield_to_others()
    from hapticlink.visualization.interactive import prediction

    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever prints must not get between the answer
    with suppress(EOFError):
        scene, changes = pickle.load(sys.stdin.buffer), pickle.load(sys.stdin.buffer)
        threading.Thread(target=_end_with_caller, daemon=True).start()
        out.write(json.dumps(prediction.predicted(scene, *changes)).encode())
        out.flush()


def _yield_to_others() -> None:
    """Take a low priority, and one processor."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    if sys.platform != "win32":
        os.nice(NICE)
    with suppress(OSError):  # where Linux groups sessions, `nice` counts within one only
        Path("/proc/self/autogroup").write_text(str(NICE))


def _end_with_caller() -> None:
    """End the process when nobody waits for its answer any more."""
    sys.stdin.buffer.read()
    temporary_folders.clear(os.getpid())
    os._exit(1)


if __name__ == "__main__":
    main()
