"""The operations of a run as records for the compiled loop, and what it returns to Python for."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.fmi.setter import Setter
from hapticlink.orchestrator.plan.operations import (
    Blend,
    Instruction,
    OfFmu,
    OfHold,
    Record,
    Set,
    Step,
    StopWhen,
)
from hapticlink.orchestrator.run.compiled import fmus, structures
from hapticlink.orchestrator.run.compiled.fmus import Memory
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold
from hapticlink.orchestrator.run.compiled.structures import Structure
from hapticlink.orchestrator.run.instructions import OfMeter
from hapticlink.orchestrator.run.python_operations import OperationsInPython
from hapticlink.orchestrator.run.simulation import Call, Simulation

Op: Any = structures.Op
PATIENCE = 20_000_000
"""ns after which Python gets a turn: signals, progress."""
KINDS = ("fmu", "setter", "hold", "meter", "table")
"""Of objects that operations refer to by the index in an array of `loop`."""


class Stop(Exception):
    """Raised when the scene's stop condition holds."""


class Machine:
    """The operations of a simulation for the compiled loop; `in_python` are those that are carried
    out in Python, with the reason."""

    def __init__(self, simulation: Simulation) -> None:
        self.library, self._simulation = simulation.library, simulation
        self.in_python: dict[str, str] = {}
        system = simulation.system
        self.loop = simulation.loop
        self._memory = Memory()
        self._kept: list[object] = []
        self._instructions: list[Instruction] = []
        self.operations = OperationsInPython(simulation, self.joined)
        self._points: list[tuple[float, float]] = []
        self._fmus = self._array("fmus", structures.Fmu, len(system.fmus))
        self._setters = self._array("setters", structures.Setter, 2 * len(system.fmus))
        n_tables = len(system.timeline.clocks) + len(system.recording.slower)
        self._tables = self._array("tables", structures.Table, n_tables)
        self._holds = self._array("holds", ctypes.c_void_p, len(system.connections))
        self._meters = self._array("meters", ctypes.c_void_p, len(simulation.meters.of))
        self._indices: dict[str, dict[Any, int]] = {kind: {} for kind in KINDS}
        self._records: dict[Instruction, Structure] = {}
        self._ops: list[Structure] = []

    def _array(self, name: str, kind: Any, n: int) -> Any:
        array = (kind * max(n, 1))()
        self.loop.fill(**{name: array})
        return array

    def change_hold(self, name: str, hold: CompiledHold, stamp: int) -> None:
        """Replace the hold of a connection; it begins with the newest sample, of tick `stamp`."""
        index, loop = self._hold(name), ctypes.addressof(self.loop)
        self._simulation.holds[name] = hold
        while code := self.library.change_hold(loop, index, hold.address, stamp):
            hold.serve(code)

    # --- what the arrays of `loop` hold -----------------------------------------------------

    def names(self, kind: str) -> list[Any]:
        """The keys of the objects of one of KINDS, in the order of their array."""
        return [*self._indices[kind]]

    def counts(self) -> dict[str, int]:
        """The number of entries of each array, by the names that loop.h uses."""
        of_objects = {f"n_{kind}s": len(indices) for kind, indices in self._indices.items()}
        return {**of_objects, "n_ops": len(self._instructions), "n_points": len(self._points)}

    def has_operations_of(self, other: Machine) -> bool:
        """Whether the operations are those of another simulation, and the numbers of objects."""
        return self._indices == other._indices and self._instructions == other._instructions

    # --- records --------------------------------------------------------------------------

    def block(self, sequence: Sequence[Instruction]) -> tuple[int, int]:
        """Adds a sequence of instructions, which the loop sees after `publish`; the indices of its
        first, and of the one after its last."""
        first = len(self._instructions)
        self._instructions += sequence
        for instruction in sequence:  # kinds of events share most of theirs
            if (record := self._records.get(instruction)) is None:
                record = self._records[instruction] = self._record(instruction)
            self._ops.append(record)
        return first, len(self._instructions)

    def publish(self) -> None:
        """Let the loop see all that was added."""
        self.loop.fill(ops=(Op * len(self._ops))(*self._ops))

    def forget_operations(self) -> None:
        """Be without operations, but with all that they work on."""
        for each in (self._instructions, self._records, self._ops, self._points, self.in_python):
            each.clear()

    def joined(self, sequence: Sequence[Instruction]) -> Call:
        """One call that carries out a sequence of instructions at a tick."""
        first, last = self.block(sequence)
        self.publish()
        position, run = structures.At(), self.library.block
        loop, here = ctypes.addressof(self.loop), ctypes.addressof(position)

        def call(tick: int) -> None:
            position.op, position.last = first, last
            while code := self.code(position, run, loop, here, tick):
                self.serve(code, position, tick)

        return call

    def _record(self, instruction: Instruction) -> Structure:
        """The record of an operation; of one that is carried out in Python the reason is noted."""
        on = instruction.why_in_python or self._object(instruction)
        if isinstance(on, str):
            first = next(iter(vars(instruction).values()), "")
            of = f" {first}" if isinstance(first, str) and first else ""
            self.in_python[f"{type(instruction).__name__.lower()}{of}"] = on
            return Op(structures.PYTHON)
        numbers = instruction.numbers(self._simulation.system)
        if isinstance(instruction, Blend):
            first = len(self._points)
            self._points += [(weight, float(ahead)) for weight, ahead in instruction.points]
            self.loop.fill(points=np.array(self._points))
            numbers = {"b": first, "c": len(self._points)}
        return Op(getattr(structures, instruction.code), on, **numbers)

    def _object(self, instruction: Instruction) -> int | str:
        """The index of what an operation works on; why the loop cannot work on that."""
        simulation, system = self._simulation, self._simulation.system
        match instruction:
            case Step(fmu) if fmu in simulation.beside:
                return "the FMU runs beside the loop, in a thread"
            case OfFmu(fmu):
                if isinstance(instruction, Set):
                    index = self._setter(fmu, instruction.now)
                else:
                    index = self._fmu(fmu)
                if index is not None:
                    return index
                if fmu in simulation.isolated:
                    return "the FMU runs in a process of its own"
                return "the FMU has event mode, or its texts are connected"
            case OfHold(connection):
                return self._hold(connection)
            case OfMeter(connection):
                return self._meter(connection)
            case Record(table):
                return self._table(table)
            case _:
                assert isinstance(instruction, StopWhen)
                condition = system.ends_when
                assert condition is not None
                return simulation.signals.scalar(condition.fmu, condition.variable)

    def _index(self, kind: str, key: Any, make: Callable[[int], object]) -> int:
        """The index of an object of `kind`, made at its first use."""
        indices = self._indices[kind]
        if key not in indices:
            self._kept.append(make(len(indices)))
            indices[key] = len(indices)
        return indices[key]

    def _fmu(self, name: str) -> int | None:
        instance = self._simulation.instances[name]
        if not (isinstance(instance, InProcess) and instance.in_c):
            return None
        check = self._simulation.step_checks.get(name)
        return self._index(
            "fmu",
            name,
            lambda index: fmus.of_instance(instance, check, self._fmus[index], self._memory),
        )

    def _setter(self, name: str, now: bool) -> int | None:
        setter, instance = self._simulation.setters[name, now], self._simulation.instances[name]
        if not isinstance(setter, Setter) or not isinstance(instance, InProcess):
            return None
        if instance.texts or any(transfer.exact for transfer in setter.transfers):
            return None
        return self._index(
            "setter",
            (name, now),
            lambda index: fmus.of_setter(setter, instance, self._setters[index], self._memory),
        )

    def _hold(self, connection: str) -> int:
        hold = self._simulation.holds[connection]
        if hold.own:
            self.in_python[f"hold of {connection}"] = f"{hold.parts.name} is a plugin's"

        def make(index: int) -> object:
            self._holds[index] = hold.address
            return hold

        return self._index("hold", connection, make)

    def _meter(self, connection: str) -> int:
        meter = self._simulation.meters.of[connection]

        def make(index: int) -> object:
            self._meters[index] = ctypes.addressof(meter.c)
            return meter

        return self._index("meter", connection, make)

    def begin_again(self) -> None:
        """Take over what is new at each start: recorders, and what instances have found there."""
        for clock, index in self._indices["table"].items():
            self._fill_table(clock, index)
        for name, index in self._indices["fmu"].items():
            fmus.begin_again(self._simulation.instances[name], self._fmus[index])

    def _table(self, clock: str) -> int:
        return self._index("table", clock, lambda index: self._fill_table(clock, index))

    def _fill_table(self, clock: str, index: int) -> None:
        recorder, c = self._simulation.recorders[clock], self._tables[index]
        if recorder.rows is not None:
            c.fill(block=recorder.rows, rows=recorder.filled)
        c.fill(recorder, "room", "due", "count", "reached", "every", "end", "view")
        where = recorder.places if recorder.view is None else None
        c.fill(n=len(recorder.places), where=where)

    # --- what the loop returns for --------------------------------------------------------

    def code(self, position: structures.At, run: Callable[..., int], *arguments: int) -> int:
        """What a function of the loop returns. Raises FmuFault for an exception that a Python FMU
        left behind in it."""
        try:
            return run(*arguments)
        except SystemError as error:
            instruction = self._instructions[position.op]
            assert isinstance(instruction, OfFmu)
            instance = self._simulation.instances[instruction.fmu]
            assert isinstance(instance, InProcess)
            raise instance.raised(
                self._called(instruction, position.what, instance), error
            ) from error

    def serve(self, code: int, position: structures.At, tick: int) -> None:
        """Does what the loop cannot do at operation `position.op`, and sets where it goes on."""
        instruction = self._instructions[position.op]
        simulation = self._simulation
        if code == structures.CALL:
            simulation.late = self.loop.late
            self.operations(instruction, tick)
        elif code == structures.STOP:
            raise Stop
        elif code in (structures.GROW, structures.REFUSED):
            self._make_room(instruction, code)
            return
        elif code == structures.SETTLE:
            assert isinstance(instruction, Step)
            instance, now = simulation.instances[instruction.fmu], simulation.time(tick)
            if instance.place.waiting <= now:
                instance.settle(now)
                return
            self.operations(instruction, tick)  # what waits for a time within this step
        else:
            assert isinstance(instruction, OfFmu)
            instance = simulation.instances[instruction.fmu]
            assert isinstance(instance, InProcess)
            if code == structures.FAILED:
                called = self._called(instruction, position.what, instance)
                raise instance.failed(called, position.status)
            if code == structures.UNRESTORED:
                called = f"fmi{instance.description.fmi}SetFMUstate"
                raise instance.failed(called, position.status)
            if code == structures.JUDGE:
                instance.judge()
            elif code == structures.STEPPED:
                instance.after_step(position.status)
            else:
                assert code == structures.UNSAVED
                called = f"fmi{instance.description.fmi}GetFMUstate"
                raise instance.failed(called, position.status)
        position.op += 1

    def _make_room(self, instruction: Instruction, code: int) -> None:
        """Give what an instruction works on what it lacks."""
        simulation = self._simulation
        match instruction:
            case OfHold(connection):
                simulation.holds[connection].serve(code)
            case OfMeter(connection):
                simulation.meters.of[connection].grow()
            case _:
                assert isinstance(instruction, Step)
                simulation.step_checks[instruction.fmu].grow()

    def _called(self, instruction: Instruction, number: int, instance: InProcess) -> str:
        """The name of the failed call of a get, a set or a step."""
        if number < 0:
            return instance.do_step
        if not isinstance(instruction, Set):
            return instance.asked[number].name
        setter = self._simulation.setters[instruction.fmu, instruction.now]
        assert isinstance(setter, Setter)
        return setter.transfers[number].name
