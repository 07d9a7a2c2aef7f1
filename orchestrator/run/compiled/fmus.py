"""FMUs of this process and their calls as structures of the compiled loop."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.fmi.fmi3_differences import InProcess3
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.fmi.setter import Setter
from hapticlink.orchestrator.fmi.transfer import Transfer
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.step_check import SLOT, StepCheck

LINE = 64
"""Bytes of a cache line."""
BLOCK = 1 << 16
_NAMED = {"Real": "DOUBLE", "Float64": "DOUBLE", "Float32": "FLOAT", "Integer": "INT32"}
"""The names of types in loop.h, where they are others there; BOOL2 and BOOL3 are apart."""


class Memory:
    """Rooms in blocks of memory, which live as long as this object, in the order in which they are
    asked for: what an operation reads lies in few cache lines, and the next operation's behind
    them."""

    def __init__(self) -> None:
        self._blocks: list[Any] = []
        self._next = self._end = 0

    def room(self, size: int) -> int:
        """The address of `size` bytes, zeros, from the beginning of a cache line on."""
        whole = -(-size // LINE) * LINE
        if self._next + whole > self._end:
            block = ctypes.create_string_buffer(max(BLOCK, whole) + LINE)
            self._blocks.append(block)
            self._next = -(-ctypes.addressof(block) // LINE) * LINE
            self._end = ctypes.addressof(block) + len(block)
        address, self._next = self._next, self._next + whole
        return address

    def copy(self, array: Any) -> int:
        """The address of a copy of an array."""
        content = memoryview(array).cast("B")
        address = self.room(len(content))
        ctypes.memmove(address, content.tobytes(), len(content))
        return address


def of_transfers(transfers: Sequence[Transfer], instance: InProcess, memory: Memory) -> int:
    """The calls of a get or a set."""
    size = ctypes.sizeof(structures.Transfer)
    first = memory.room(size * len(transfers))
    for i, t in enumerate(transfers):
        c = structures.Transfer.from_address(first + i * size)
        c.fill(t, "buffer", "values", call=t.function, fmu=t.component, n=len(t.values))
        c.fill(references=memory.copy(t.references), n_references=len(t.references))
        name = f"BOOL{t.fmi}" if t.type == "Boolean" else _NAMED.get(t.type, t.type.upper())
        c.kind.fill(type=getattr(structures, name), fmi=int(t.fmi), python=instance.holds_python)
    return first


def of_instance(
    instance: InProcess, check: StepCheck | None, c: structures.Fmu, memory: Memory
) -> structures.Fmu:
    """Fills `c`, which has to be kept."""
    fmi, slave = instance.description.fmi, instance.slave
    c.fill(instance, "place", "outputs", "row_due", "good", "forward", fmu=slave.component)
    c.fill(do_step=slave.dll[f"fmi{fmi}DoStep"], n_outputs=len(instance.outputs))
    c.kind.fill(fmi=int(fmi), python=instance.holds_python)
    if isinstance(instance, InProcess3):
        event, terminate, early = instance.step_flags
        c.fill(instance, "reached", event=event, terminate=terminate, early=early)
    c.gets, c.n_gets = of_transfers(instance.gets, instance, memory), len(instance.gets)
    c.inverse = memory.copy(instance.bounds.inverse)
    if instance.converted is not None:
        c.factors, c.offsets = map(memory.copy, instance.converted)
    c.gets_between_rows, c.n_gets_between_rows = c.gets, c.n_gets
    if instance.gets_between_rows is not instance.gets:
        c.gets_between_rows, c.n_gets_between_rows = (
            of_transfers(instance.gets_between_rows, instance, memory),
            len(instance.gets_between_rows),
        )
    if check:
        _fill_with(check, instance, c)
    return c


def begin_again(instance: Instance, c: structures.Fmu) -> None:
    """Takes over what an instance has found at another start."""
    c.fill(instance, "row_due", "good", n_steps=0, untimed=0)
    inverse = instance.bounds.inverse
    ctypes.memmove(c.inverse, inverse.ctypes.data, inverse.nbytes)


def _fill_with(check: StepCheck, instance: InProcess, fmu: structures.Fmu) -> None:
    c, saved = check.c, instance.slot(SLOT)
    fmu.fill(check=c)
    c.fill(saved, "state", get_state=saved.get, set_state=saved.set)
    if saved.overwrites:
        fmu.fill(saved, "free_state")


def of_setter(setter: Setter, instance: InProcess, c: structures.Setter, memory: Memory) -> None:
    """Fills `c`."""
    c.fill(setter, "place", "key", "values", "factors", "offsets", "into", "whole")
    c.fill(n=len(setter.where), where=memory.copy(setter.where))
    c.fill(sets=of_transfers(setter.transfers, instance, memory), n_sets=len(setter.transfers))
