"""An instance whose FMU runs in a process of its own: when that dies or hangs, the run does not.

The worker has an `Instance`; here each call is a message to it and its answer. Inputs set between
two steps go with the step, and the outputs come back with it, so that a step is one message.
A watchdog kills a worker that is late; the waiting read then ends like any other death.
"""

from __future__ import annotations

import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from time import monotonic
from typing import Any

import numpy as np

from hapticlink.orchestrator.description import Scalar
from hapticlink.orchestrator.faults import FmuFault
from hapticlink.orchestrator.fmu import Instance, Vector

CLOSING = 10.0
"""Seconds that an FMU may take to terminate."""
LOADING = 60.0
"""Seconds at least that a process and its FMU may take to load, whatever the timeout of a call."""


class Isolated(Instance):
    """An FMU in a worker process."""

    _worker: subprocess.Popen[bytes] | None = None
    _deadline: float | None = None
    _late = False

    def _load(self) -> None:
        self._pending: list[tuple[int, Vector]] = []
        self._ended = threading.Event()
        # -P: the worker's imports do not depend on the folder that the user stands in.
        command = [sys.executable, "-P", "-m", "hapticlink.orchestrator.worker"]
        self._worker = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        threading.Thread(target=self._watch, daemon=True).start()
        what = (self.name, self.description, len(self.outputs), self.starts, self.policy)
        self._ask("load", *what, self._folder)

    def _watch(self) -> None:
        assert self._worker is not None
        while not self._ended.wait(0.05):
            if self._deadline is not None and monotonic() > self._deadline:
                self._late = True
                self._worker.kill()
                return

    def _ask(self, call: str, *arguments: Any) -> Any:
        """The worker's answer. Raises its FmuFault, or one that says how it ended."""
        worker = self._worker
        assert worker is not None
        assert worker.stdin is not None
        assert worker.stdout is not None
        self._allowed = self.policy.timeout
        if call == "load":
            self._allowed = max(self._allowed, LOADING)
        self._deadline = monotonic() + self._allowed
        try:
            pickle.dump((call, arguments), worker.stdin)
            worker.stdin.flush()
            kind, answer = pickle.load(worker.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise self._died() from None
        finally:
            self._deadline = None
        if kind == "fault":
            raise FmuFault(self.name, *answer)
        return answer

    def _died(self) -> FmuFault:
        worker, self._worker = self._worker, None
        assert worker is not None
        self._ended.set()
        code = _end(worker)
        if self._late:
            how = f"did not answer within {self._allowed:g} s and was ended"
        elif code < 0:
            how = f"ended by {signal.Signals(-code).name}"
        else:
            how = f"ended with exit status {code}"
        return FmuFault(self.name, f"its process {how}", self.time)

    # --- the calls of Instance ------------------------------------------------------------

    def connect(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Callable[[Vector], None]:
        where = np.array(places, dtype=np.intp)
        key = self._ask("connect", list(scalars))

        def set_from(board: Vector) -> None:
            values = board[where]
            if self._initialized:
                self._pending.append((key, values))
            else:
                self._ask("set", key, values)

        return set_from

    def enter_initialization(self, stop_time: float) -> None:
        self._ask("enter_initialization", stop_time)

    def exit_initialization(self) -> None:
        self._ask("exit_initialization")
        self._start_loop()

    def read(self) -> None:
        if self._fresh is None or self._pending:
            pending, self._pending = self._pending, []
            self._fresh = self._ask("read", pending)
        self.outputs[:] = self._fresh
        if not self._initialized:
            self._fresh = None

    _fresh: Vector | None = None
    _smaller = 0

    @property
    def smaller_steps(self) -> int:
        return self._smaller

    def step(self, time: float, end: float, size: float) -> None:
        self.time = time
        pending, self._pending = self._pending, []
        self._fresh, self.step_time, self._smaller = self._ask("step", pending, time, end, size)
        self.time = end

    def save(self, slot: int = 0) -> None:
        pending, self._pending = self._pending, []
        self._ask("save", pending, slot)
        self._saved_time[slot] = self.time

    def rollback(self, slot: int = 0) -> None:
        self._pending, self._fresh = [], None  # inputs are part of the state
        self._ask("rollback", slot)
        self.time = self._saved_time[slot]

    def close(self) -> None:
        worker = self._worker
        if worker is None:
            super().close()
            return
        self.policy = replace(self.policy, timeout=CLOSING)
        try:
            with suppress(FmuFault):  # the run has its results, and the process ends below
                self._ask("close")
        finally:
            self._ended.set()
            _end(worker)
            super().close()


def _end(worker: subprocess.Popen[bytes]) -> int:
    """The exit status of a worker that has nothing more to do; killed where it lingers."""
    for stream in (worker.stdin, worker.stdout):
        if stream is not None:
            with suppress(OSError):  # bytes that a dead process has not taken
                stream.close()
    try:
        return worker.wait(CLOSING)
    except subprocess.TimeoutExpired:
        worker.kill()
        return worker.wait()
