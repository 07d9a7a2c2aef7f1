"""The process of an isolated FMU: answers the messages of `isolated.Isolated` until it is asked to
close or the calling process has ended."""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, BinaryIO

import numpy as np

from hapticlink.orchestrator.base.errors import AsksToEnd, FmuFault
from hapticlink.orchestrator.base.process import leave_threads
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.in_process import in_process
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.fmi.units import SAME
from hapticlink.orchestrator.fmi.variables import Scalar

PR_SET_PDEATHSIG = 1  # linux/prctl.h


class HostedFmu:
    """One instance and the ways to set its inputs."""

    DIRECT = (
        *("enter_initialization", "exit_initialization", "jacobian"),
        *("save", "rollback", "serialized", "deserialize"),
    )
    """Calls that are those of the instance."""

    def __init__(self) -> None:
        self._instance: Instance | None = None
        self._inputs: dict[str, Scalar] = {}
        self._setters: list[Callable[[Any], None]] = []

    @property
    def instance(self) -> Instance:
        assert self._instance is not None
        return self._instance

    def load(
        self,
        name: str,
        description: Description,
        starts: Any,
        policy: Any,
        folder: str = "",
        log_path: str = "",
        goes_back: bool = True,
    ) -> None:
        self._inputs = {s.name: s for s in description.scalars if s.causality != "output"}
        kind, outputs = in_process(description), np.zeros(len(description.outputs))
        self._instance = kind(name, description, outputs, starts, policy, folder)
        self.instance.log_path, self.instance.goes_back = log_path, goes_back
        self.instance.__enter__()

    def connect(self, names: Sequence[str]) -> int:
        """The key of a setter of these inputs, whose values come converted."""
        scalars = [replace(self._inputs[name], conversion=SAME) for name in names]
        self._setters.append(self.instance.connect(scalars, range(len(names))))
        return len(self._setters) - 1

    def called(self, pending: Any, call: str, arguments: Any) -> Any:
        """What a call returns, once inputs are set as `pending` says: (key, values as bytes) of
        setters, in order."""
        for key, values in pending:
            self._setters[key](np.frombuffer(values))
        of = self.instance if call in self.DIRECT else self
        return getattr(of, call)(*arguments)

    def read(self) -> bytes:
        self.instance.read()
        return self.instance.outputs.tobytes()

    def read_some(self, places: Sequence[int]) -> bytes:
        self.instance.read_some(places)
        return self.instance.outputs[list(places)].tobytes()

    def step(self, time: float, end: float, size: float) -> Any:
        """Returns (outputs, or the fault in reading them; whether the FMU has requested the end;
        time spent in doStep (s))."""
        outputs, fault = b"", None
        instance = self.instance
        instance.step(time, end, size)
        try:
            outputs = self.read()
        except FmuFault as failed:  # raised when somebody reads
            fault = fault_fields(failed)
        return outputs, fault, instance.ended, instance.step_time

    def close(self) -> dict[str, int]:
        """Returns the number of calls of the loop, by kind."""
        instance, self._instance = self._instance, None
        if instance is None:
            return {}
        if fault := instance.close():
            raise fault
        return instance.calls


def fault_fields(fault: FmuFault) -> tuple[Any, ...]:
    """The arguments of a fault behind the name of its FMU, as plain data."""
    return fault.what, float(fault.time), fault.messages, fault.repeatable


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer requests until `close`, or until the stream ends."""
    worker = HostedFmu()
    call = ""
    while call != "close":
        try:
            pending, call, arguments = pickle.load(requests)
        except EOFError:
            break
        try:
            answer = ("answer", worker.called(pending, call, arguments))
        except FmuFault as fault:
            answer = ("end" if isinstance(fault, AsksToEnd) else "fault", fault_fields(fault))
        pickle.dump(answer, answers)
        answers.flush()
    with suppress(FmuFault):  # nobody is left to receive it
        worker.close()


def main() -> None:
    """Messages use standard input and output; what the FMU prints goes to standard error."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # the caller ends the run, and then this process
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    with os.fdopen(os.dup(0), "rb") as requests, os.fdopen(os.dup(1), "wb") as answers:
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        os.dup2(2, 1)
        serve(requests, answers)
    leave_threads(0)


if __name__ == "__main__":
    main()
