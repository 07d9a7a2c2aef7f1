"""A worker process with at most one pending call.

A watchdog kills a process that exceeds its time; the pending read then ends as if the process had
died by itself.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from time import monotonic
from typing import Any

from hapticlink.orchestrator.base import interrupt

ENDING = 10.0
"""Seconds that a process may take to end when nobody asks it anything any more."""
WATCH = 0.05
"""Seconds between two looks at the clock."""


# Ctrl-C in the terminal goes to the caller alone, which ends the run and then this process.
OWN_GROUP: Any = (
    {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
    if sys.platform == "win32"
    else {"start_new_session": True}
)


class Died(Exception):
    """The process ended without an answer; the message says how."""


class Process:
    """`send` a call, then take its `answer`; one call at a time. `busy`: the answer is due."""

    def __init__(self, module: str) -> None:
        # -P: the worker's imports do not depend on the folder that the user stands in.
        command = [sys.executable, "-P", "-m", module]
        self._popen = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, **OWN_GROUP
        )
        assert self._popen.stdin is not None
        assert self._popen.stdout is not None
        self._requests, self._answers = self._popen.stdin, self._popen.stdout
        self._ended = threading.Event()
        self._deadline: float | None = None
        self._late = self.busy = False
        self.interruptible = False
        """Whether the first signal already ends the process: it has nothing to lose yet."""
        interrupt.add(self.kill)
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        while not self._ended.wait(WATCH):
            if self.interruptible and interrupt.came():
                self.kill()
                return
            if self._deadline is not None and monotonic() > self._deadline:
                self._late = True
                self.kill()
                return

    def kill(self) -> None:
        """Kill the process group: the process and those that its FMU has started."""
        if sys.platform == "win32":
            self._popen.kill()
        else:
            with suppress(OSError):  # there is none any more
                os.killpg(self._popen.pid, signal.SIGKILL)

    def send(self, message: Any, allowed: float) -> None:
        """Send a call, whose answer may take `allowed` s. Raises Died."""
        self._allowed, self._sent, self.busy = allowed, monotonic(), True
        try:
            pickle.dump(message, self._requests)
            self._requests.flush()
        except OSError:
            raise self._died() from None

    def answer(self, allowed: float | None = None) -> Any:
        """Wait for the answer, if given for another `allowed` s. Raises Died."""
        now = monotonic()
        if allowed is not None:
            self._allowed, self._sent = allowed, now
        # An answer that is there already is taken, however late it is asked for.
        self._deadline = max(self._sent + self._allowed, now + 2 * WATCH)
        try:
            answer = pickle.load(self._answers)
        except Exception:  # the end of the stream, or what is left of an answer cut in two
            raise self._died() from None
        finally:
            self._deadline = None
        self.busy = False
        return answer

    def _died(self) -> Died:
        self.busy = False
        code = self.end()
        if self._late:
            return Died(f"did not answer within {self._allowed:g} s and was ended")
        if code < 0:
            return Died(f"ended by {signal.Signals(-code).name}")
        return Died(f"ended with exit status {code}")

    def end(self) -> int:
        """Wait for the process to end, kill it and its group if it does not, and return its exit
        status."""
        self._ended.set()
        for stream in (self._requests, self._answers):
            with suppress(OSError):  # bytes that a dead process has not taken
                stream.close()
        try:
            return self._popen.wait(ENDING)
        except subprocess.TimeoutExpired:
            self.kill()
            return self._popen.wait()
        finally:
            self.kill()
            interrupt.remove(self.kill)
