"""Runs that a process keeps for the next system that differs from theirs in start values and
clocks alone: FMUs, holds and meters stay as they are, and their memory is put back to what it was
before the start; with the same clocks operations stay too.

A run is kept if C carries out all of it, in FMUs that can be reset, with results in memory; and if
it came to its end without a fault, and nothing in the memory of the loop has grown.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base import plugins, shelf
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.run.compiled.regions import (
    Regions,
    find_embedded,
    is_structure,
    of_type,
    size,
)
from hapticlink.orchestrator.run.compiled.structures import POINTERS
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.system.system import System

MOST = 16
"""Runs that a process keeps."""
Words = NDArray[np.uint64]


class StartMemory:
    """What was in the memory of signals, holds, meters and step checks when they were made; their
    pointers are those of a run that is prepared."""

    def __init__(self, simulation: Simulation) -> None:
        regions = [region for each in _roots(simulation) for region in each.all]
        self._memory = [_words(r.address, r.end) for r in regions]
        self._before = [memory.copy() for memory in self._memory]
        self._pointers = [_pointers(r.type, r.count) for r in regions]

    def take_pointers(self) -> None:
        """Take over the pointers that are there now."""
        for memory, before, pointers in self._each():
            before[pointers] = memory[pointers]

    @property
    def has_moved(self) -> bool:
        """Whether there are other pointers now, since something has grown."""
        return any((before[at] != memory[at]).any() for memory, before, at in self._each())

    def put_back(self) -> None:
        for memory, before in zip(self._memory, self._before, strict=True):
            memory[:] = before

    def _each(self) -> Iterator[tuple[Words, Words, NDArray[np.intp]]]:
        every = zip(self._memory, self._before, self._pointers, strict=True)
        return (each for each in every if len(each[2]))


def _roots(simulation: Simulation) -> Iterator[Regions]:
    """The regions of what a simulation owns."""
    values = simulation.signals.values
    yield Regions([("values", "double", values.ctypes.data, len(values))], {})
    owned = {
        "Hold": [hold.c for hold in simulation.holds.values()],
        "Meter": [meter.c for meter in simulation.meters.of.values()],
    }
    for type_, each in owned.items():
        for c in each:
            yield Regions([("root", type_, ctypes.addressof(c), 1)], {})
    for name, check in simulation.step_checks.items():
        outputs = len(simulation.instances[name].outputs)
        root = ("root", "Check", ctypes.addressof(check.c), 1)
        yield Regions([root], {"n_outputs": outputs})


def _words(address: int, end: int) -> Words:
    """The memory from an address to another, of fields of 8 bytes each."""
    words = (ctypes.c_uint64 * ((end - address) // 8)).from_address(address)
    return np.frombuffer(memoryview(words), np.uint64)


def _pointers(type_: str, count: int) -> NDArray[np.intp]:
    """The places of the pointers among the words of a region."""
    if not is_structure(type_):
        return np.zeros(0, np.intp)
    words, places = size(type_) // 8, [*_pointers_within(type_, 0)]
    return np.array([words * i + place for i in range(count) for place in places], np.intp)


def _pointers_within(type_: str, first: int) -> Iterator[int]:
    kind = of_type(type_)
    for name in POINTERS.get(type_, {}):
        yield first + getattr(kind, name).offset // 8
    for name, field in find_embedded(type_):
        if issubclass(field, ctypes.Structure):
            yield from _pointers_within(field.__name__, first + getattr(kind, name).offset // 8)


@dataclass(frozen=True)
class KeptRun:
    """The objects of a run that has ended; `opened` closes its FMUs."""

    plan: Plan
    simulation: Simulation
    loop: CompiledLoop
    memory: StartMemory
    opened: ExitStack

    def end(self) -> bool:
        """End the run of the FMUs; whether all can begin another. Raises FmuFault for one that
        fails in this."""
        instances = [i for i in self.simulation.instances.values() if isinstance(i, InProcess)]
        for instance in instances:
            if fault := instance.terminate():
                raise fault
        return all([instance.reset() for instance in instances])

    def begin_again(self, plan: Plan, results: RunResults, stack: ExitStack) -> KeptRun:
        """This run, before the first event of one of the system of `plan`. Raises as a start
        does."""
        self.memory.put_back()
        self.loop.complete = 0
        same_time = plan.system.timeline == self.simulation.system.timeline
        self.simulation.begin_again(plan.system, results, stack)
        self.simulation.start()
        if same_time:
            self.loop.begin_again()
            return self
        self.loop.take_plan(plan)
        return replace(self, plan=plan)


_RUNS: shelf.Shelf[KeptRun] = shelf.Shelf(MOST, lambda run: run.opened.close())


def may_be_kept(simulation: Simulation, results: RunResults) -> bool:
    """Whether a run can be one of those that are kept, before it starts."""
    return (
        shelf.is_keeping()
        and not results.log_path
        and not plugins.list_plugins()
        and simulation.pace is None
        and all(isinstance(i, InProcess) and i.resets for i in simulation.instances.values())
        and not any(hold.own for hold in simulation.holds.values())
    )


def take(system: System) -> KeptRun | None:
    """A run whose system differs from `system` in start values and clocks alone."""
    return _RUNS.take(lambda run: run.simulation.system.is_alike(system))


def keep(run: KeptRun) -> None:
    """Keep a run that came to its end, where nothing has grown and C has carried out all of it."""
    if run.loop.in_python or run.memory.has_moved:
        run.opened.close()
    else:
        _RUNS.put(run)
