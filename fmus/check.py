"""Checks that every FMU of the project, Python or native, has to pass.

A run sets inputs near their start values, steps and gets all reals. Runs that should be equal,
after loading again, reset, in a second instance, or from a saved state, have to agree to the bit.
"""

from __future__ import annotations

import math
import shutil
import tempfile
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from copy import copy
from functools import partial
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.plain_folder import find_unpacking_folder, require_plain

STEPS = 4
Trace = list[bytes]


class Slave3(FMU3Slave):
    """An instance of FMI 3.0 with the calls of FMI 2.0 that are made here. Its variables are
    Float64, and an entry of an array has the value reference of the array plus its index."""

    def __init__(self, sizes: Mapping[int, int], **about: Any) -> None:
        super().__init__(**about)
        self._sizes = sizes
        self._first = {first + i: first for first, size in sizes.items() for i in range(size)}
        self._times: dict[str, float | None] = {}

    def setupExperiment(self, startTime: float = 0.0, stopTime: float | None = None) -> None:
        self._times = {"startTime": startTime, "stopTime": stopTime}

    def enterInitializationMode(self) -> None:
        super().enterInitializationMode(**self._times)

    def getReal(self, references: Sequence[int]) -> list[float]:
        arrays = {self._first.get(r, r): list[float]() for r in references}
        for first, values in arrays.items():
            values += self.getFloat64([first], self._sizes.get(first, 1))
        return [arrays[self._first.get(r, r)][r - self._first.get(r, r)] for r in references]

    def setReal(self, references: Sequence[int], values: Sequence[float]) -> None:
        firsts = sorted({self._first[r] for r in references})
        entries = [first + i for first in firsts for i in range(self._sizes[first])]
        given = dict(zip(entries, self.getReal(entries), strict=True))
        given |= dict(zip(references, values, strict=True))
        self.setFloat64(firsts, [given[r] for r in entries])

    serializeFMUstate = FMU3Slave.serializeFMUState
    deSerializeFMUstate = FMU3Slave.deserializeFMUState


def _entries(variable: Any) -> Iterator[Any]:
    """The scalars of a variable, as FMI 2.0 has them."""
    places = [*np.ndindex(*variable.shape or ())]
    starts = (variable.start or "").split() or [None] * len(places)
    for i, (place, start) in enumerate(zip(places, starts, strict=True)):
        scalar = copy(variable)
        scalar.name += f"[{','.join(str(k + 1) for k in place)}]" if place else ""
        scalar.valueReference, scalar.start, scalar.type = (
            variable.valueReference + i,
            start,
            "Real",
        )
        yield scalar


def _unpack(path: Path | str, folder: Path | None = None) -> str:
    """The folder in which an FMU is unpacked. Raises FmuError where it would crash from there."""
    unpacked = str(folder or tempfile.mkdtemp(dir=find_unpacking_folder()))
    fmpy.extract(str(path), unpacked)
    try:
        require_plain(unpacked)
    except FmuError:
        shutil.rmtree(unpacked)
        raise
    return unpacked


class FmuSession:
    """An FMU that is extracted to `folder`, by default a new temporary one, and its instances, all
    of which `close` frees. `description` has scalars, also of FMI 3.0."""

    def __init__(self, path: Path | str, folder: Path | None = None) -> None:
        self.description = fmpy.read_model_description(str(path), validate=False)
        self.make: Callable[..., Any] = FMU2Slave
        if self.description.fmiVersion == "3.0":
            own = [v for v in self.description.modelVariables if v.causality != "independent"]
            sizes = {v.valueReference: math.prod(v.shape or ()) for v in own}
            self.make = partial(Slave3, sizes)
            self.description.modelVariables = [entry for v in own for entry in _entries(v)]
        variables = self.description.modelVariables
        self.reals = [v.valueReference for v in variables if v.type == "Real"]
        self.inputs = [v for v in variables if v.causality == "input" and v.type == "Real"]
        experiment = self.description.defaultExperiment
        self.step_size = float(experiment.stepSize or 1e-3) if experiment else 1e-3
        self.folder = _unpack(path, folder)
        self.messages: list[str] = []
        self._instances: list[FMU2Slave] = []

    def instance(self, name: str = "instance") -> FMU2Slave:
        """A new instance, before initialisation; its log is collected in `messages`."""
        slave = self.make(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        if self.make is FMU2Slave:
            callbacks = fmi2.fmi2CallbackFunctions()
            callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)
            callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
            callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
            slave.instantiate(callbacks=callbacks, loggingOn=True)
        else:
            slave.instantiate(logMessage=self._log, loggingOn=True)
        self._instances.append(slave)
        return slave

    def initialized(self, name: str = "instance") -> FMU2Slave:
        """A new instance, ready for its first step."""
        slave = self.instance(name)
        initialize(slave)
        return slave

    def _log(self, *about: Any) -> None:
        self.messages.append(about[-1].decode())

    def free(self, slave: FMU2Slave) -> None:
        self._instances.remove(slave)
        slave.freeInstance()

    def close(self) -> None:
        """Free all instances and remove the extracted files."""
        for slave in list(self._instances):
            self.free(slave)
        shutil.rmtree(self.folder)


def session(path: Path | str, folder: Path | None = None) -> closing[FmuSession]:
    """A session that is closed at the end of the context."""
    return closing(FmuSession(path, folder))


def initialize(slave: FMU2Slave, time: float = 0.0) -> None:
    slave.setupExperiment(startTime=time)
    slave.enterInitializationMode()
    slave.exitInitializationMode()


def run(slave: FMU2Slave, session: FmuSession, first: int = 0, count: int = STEPS) -> Trace:
    """Set inputs, step, get all reals; steps `first` to `first + count - 1`."""
    references = [v.valueReference for v in session.inputs]
    trace = []
    for k in range(first, first + count):
        # Small values, all different and changing, so that lost or swapped ones are found.
        nudged = [float(v.start or 0.0) + 1e-4 * (i + 1 + k) for i, v in enumerate(session.inputs)]
        if references:
            slave.setReal(references, nudged)
        slave.doStep(k * session.step_size, session.step_size)
        trace.append(array("d", slave.getReal(session.reals)).tobytes())
    return trace


def check_fmu(path: Path | str) -> list[str]:
    """The findings of all checks of the FMU at `path`; empty if it passes."""
    findings = [f"validation: {finding}" for finding in validate_fmu(str(path))]
    if findings:
        return findings
    with session(path) as opened:
        slave = opened.initialized()
        try:
            reference = run(slave, opened)
        except FMICallException as error:
            return [f"run: {error}; {' | '.join(opened.messages)}"]
        opened.free(slave)
        for check in CHECKS:
            try:
                finding = check(opened, reference)
            except FMICallException as error:
                finding = f"{error}; {' | '.join(opened.messages)}"
            if finding:
                findings.append(f"{check.__name__.strip('_')}: {finding}")
    findings += _alone(path, opened.step_size)
    return findings


def _alone(path: Path | str, step_size: float) -> list[str]:
    """Simulated by FMPy with its start values, the FMU has to run and stay finite."""
    stop, folder = STEPS * step_size, _unpack(path)
    try:
        result = fmpy.simulate_fmu(folder, stop_time=stop, output_interval=step_size)
    except Exception as error:
        return [f"alone: {error}"]
    finally:
        shutil.rmtree(folder)
    bad = [name for name in result.dtype.names if not np.isfinite(result[name]).all()]
    return [f"alone: not finite from its own start values: {', '.join(bad)}"] if bad else []


def _inputs_read_back(session: FmuSession, _: Trace) -> str | None:
    slave = session.initialized()
    references = [v.valueReference for v in session.inputs]
    values = [float(v.start or 0.0) + 0.1 * (i + 1) for i, v in enumerate(session.inputs)]
    if references:
        slave.setReal(references, values)
    read = slave.getReal(references) if references else []
    session.free(slave)
    return None if read == values else f"set {values}, read {read}"


def _load_again(session: FmuSession, reference: Trace) -> str | None:
    return _compare(run(session.initialized(), session), reference)


def _reset(session: FmuSession, reference: Trace) -> str | None:
    slave = session.initialized()
    run(slave, session)
    slave.reset()
    initialize(slave)
    return _compare(run(slave, session), reference)


def _two_instances(session: FmuSession, reference: Trace) -> str | None:
    one, two = session.initialized("one"), session.initialized("two")
    run(one, session, count=1)
    trace = run(two, session)
    rest = run(one, session, first=1, count=STEPS - 1)
    return _compare(trace, reference) or _compare(rest, reference[1:])


def _save_and_restore(session: FmuSession, reference: Trace) -> str | None:
    slave = session.initialized()
    run(slave, session, count=2)
    state = slave.getFMUState()
    saved = slave.serializeFMUstate(state)
    run(slave, session, first=2, count=STEPS - 2)
    slave.setFMUState(state)
    slave.freeFMUState(state)
    trace = run(slave, session, first=2, count=STEPS - 2)
    return _compare(trace, reference[2:]) or _deserialize(session, saved, reference)


def _deserialize(session: FmuSession, saved: bytes, reference: Trace) -> str | None:
    """A state restored into another instance has to continue as the first one did."""
    slave = session.initialized("other")
    state = slave.deSerializeFMUstate(saved)
    if slave.serializeFMUstate(state) != saved:
        return "serialised, read and serialised again, the bytes differ"
    slave.setFMUState(state)
    slave.freeFMUState(state)
    return _compare(run(slave, session, first=2, count=STEPS - 2), reference[2:])


CHECKS: tuple[Callable[[FmuSession, Trace], str | None], ...] = (
    _inputs_read_back,
    _load_again,
    _reset,
    _two_instances,
    _save_and_restore,
)


def _compare(trace: Trace, reference: Trace) -> str | None:
    for k, (got, expected) in enumerate(zip(trace, reference, strict=True)):
        if got != expected:
            a, b = array("d", got), array("d", expected)
            i = next(i for i in range(len(a)) if a[i : i + 1].tobytes() != b[i : i + 1].tobytes())
            return f"entry {k} of the run differs in real {i}: {a[i]!r} instead of {b[i]!r}"
    return None
