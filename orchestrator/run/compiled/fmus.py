"""FMUs of this process and their calls as structures of the compiled loop."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

from hapticlink.orchestrator.fmi.in_process import InProcess
from hapticlink.orchestrator.fmi.in_process3 import InProcess3
from hapticlink.orchestrator.fmi.setter import Setter
from hapticlink.orchestrator.fmi.transfer import Transfer
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.step_check import EVERY, FIRST, StepCheck

_TYPES = {
    "Real": 0, "Float64": 0, "Float32": 1, "Int64": 2, "Integer": 3, "Int32": 3, "Int16": 4,
    "Int8": 5, "UInt64": 6, "UInt32": 7, "UInt16": 8, "UInt8": 9,
}  # fmt: skip
_BOOLEAN = {"2": 10, "3": 11}


def address(function: Any) -> int | None:
    """The address of a function of a library."""
    return ctypes.cast(function, ctypes.c_void_p).value


def of_transfers(transfers: Sequence[Transfer]) -> ctypes.Array[structures.Transfer]:
    """The calls of a get or a set."""
    made = (structures.Transfer * len(transfers))()
    for c, t in zip(made, transfers, strict=True):
        c.call, c.fmu = address(t.function), t.component
        c.references, c.n_references = ctypes.addressof(t.references), len(t.references)
        c.buffer, c.values, c.n = t.buffer.ctypes.data, t.values.ctypes.data, len(t.values)
        c.type, c.fmi = _TYPES.get(t.type, _BOOLEAN[t.fmi]), int(t.fmi)
    return made


def of_instance(instance: InProcess, check: StepCheck | None, c: structures.Fmu) -> object:
    """Fills `c`; what is returned has to be kept."""
    fmi, slave = instance.description.fmi, instance.slave
    gets = of_transfers(instance.gets)
    c.place, c.fmu = ctypes.addressof(instance.place), slave.component
    c.do_step = address(slave.dll[f"fmi{fmi}DoStep"])
    c.fmi, c.forward = int(fmi), instance.forward
    if instance.retry:
        saved = instance.retry.saved[0]
        c.get_state, c.state = address(saved.get), ctypes.addressof(saved.state)
    if isinstance(instance, InProcess3):
        c.event, c.terminate, c.early = map(ctypes.addressof, instance.told)
        c.reached = ctypes.addressof(instance.reached)
    c.gets, c.n_gets = ctypes.addressof(gets), len(gets)
    c.outputs, c.n_outputs = instance.outputs.ctypes.data, len(instance.outputs)
    c.inverse = instance.bounds.inverse.ctypes.data
    c.good = None if instance.good is None else instance.good.ctypes.data
    if check:
        c.checked, c.every, c.first = ctypes.addressof(check.steps), EVERY, FIRST
    return gets


def of_setter(setter: Setter, instance: InProcess, c: structures.Setter) -> object:
    """Fills `c`; what is returned has to be kept."""
    sets = of_transfers(setter.transfers)
    c.place, c.n = ctypes.addressof(instance.place), len(setter.where)
    c.where, c.values = setter.where.ctypes.data, setter.values.ctypes.data
    if setter.factors is not None and setter.offsets is not None:
        c.factors, c.offsets = setter.factors.ctypes.data, setter.offsets.ctypes.data
    if setter.into is not None:
        c.into, c.whole = setter.into.ctypes.data, setter.whole.ctypes.data
    c.sets, c.n_sets = ctypes.addressof(sets), len(sets)
    return sets
