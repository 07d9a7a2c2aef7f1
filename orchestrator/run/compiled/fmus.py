"""FMUs of this process and their calls as structures of the compiled loop."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from hapticlink.orchestrator.fmi.in_process import InProcess
from hapticlink.orchestrator.fmi.in_process3 import InProcess3
from hapticlink.orchestrator.fmi.setter import Setter
from hapticlink.orchestrator.fmi.transfer import Transfer
from hapticlink.orchestrator.run import step_check
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.memory import Memory
from hapticlink.orchestrator.run.step_check import SLOT, StepCheck

_NAMED = {"Real": "DOUBLE", "Float64": "DOUBLE", "Float32": "FLOAT", "Integer": "INT32"}
"""The names of types in loop.h, where they are others there; BOOL2 and BOOL3 are apart."""


def address(function: Any) -> int | None:
    """The address of a function of a library."""
    return ctypes.cast(function, ctypes.c_void_p).value


def of_transfers(transfers: Sequence[Transfer], instance: InProcess, memory: Memory) -> int:
    """The calls of a get or a set."""
    size = ctypes.sizeof(structures.Transfer)
    made = memory.room(size * len(transfers))
    for i, t in enumerate(transfers):
        c = structures.Transfer.from_address(made + i * size)
        c.call, c.fmu = address(t.function), t.component
        c.references, c.n_references = memory.copy(t.references), len(t.references)
        c.buffer, c.values, c.n = t.buffer.ctypes.data, t.values.ctypes.data, len(t.values)
        c.kind.python = instance.holds_python
        name = f"BOOL{t.fmi}" if t.type == "Boolean" else _NAMED.get(t.type, t.type.upper())
        c.kind.type, c.kind.fmi = getattr(structures, name), int(t.fmi)
    return made


def of_instance(
    instance: InProcess, check: StepCheck | None, c: structures.Fmu, memory: Memory
) -> object:
    """Fills `c`; what is returned has to be kept."""
    fmi, slave = instance.description.fmi, instance.slave
    c.place, c.fmu = ctypes.addressof(instance.place), slave.component
    c.do_step = address(slave.dll[f"fmi{fmi}DoStep"])
    c.kind.fmi, c.kind.python, c.forward = int(fmi), instance.holds_python, instance.forward
    if instance.retry:
        saved = instance.retry.saved[0]
        c.get_state, c.state = address(saved.get), ctypes.addressof(saved.state)
    if isinstance(instance, InProcess3):
        c.event, c.terminate, c.early = map(ctypes.addressof, instance.step_flags)
        c.reached = ctypes.addressof(instance.reached)
    c.gets, c.n_gets = of_transfers(instance.gets, instance, memory), len(instance.gets)
    c.outputs, c.n_outputs = instance.outputs.ctypes.data, len(instance.outputs)
    c.inverse = memory.copy(instance.bounds.inverse)
    c.fewer, c.n_fewer, c.due = c.gets, c.n_gets, ctypes.addressof(instance.due)
    if instance.fewer is not instance.gets:
        c.fewer, c.n_fewer = of_transfers(instance.fewer, instance, memory), len(instance.fewer)
    c.good = None if instance.good is None else instance.good.ctypes.data
    if check is None:
        return None
    made = structures.Check()
    c.check = ctypes.addressof(made)
    saved = instance.slot(SLOT)
    made.get_state, made.set_state = address(saved.get), address(saved.set)
    made.state = ctypes.addressof(saved.state)
    made.steps, made.count = ctypes.addressof(check.steps), ctypes.addressof(check.count)
    made.every, made.first, made.at_rest = step_check.EVERY, step_check.FIRST, step_check.AT_REST
    made.jump, made.share = step_check.JUMP, step_check.SHARE
    made.bases, made.rates, made.ports = (
        places.ctypes.data for places in (check.bases, check.rates, check.port)
    )
    made.n, made.n_ports = len(check.port), len(check.scales)
    made.scales, made.jumps, made.last = (
        values.ctypes.data for values in (check.scales, check.jumps, check.last)
    )
    made.size = ctypes.addressof(check.size)
    scratch = np.zeros((2, len(instance.outputs)))
    made.before, made.halves = scratch[0].ctypes.data, scratch[1].ctypes.data
    check.changed = partial(_fill_check, made, check)
    check.changed()
    return made, scratch


def _fill_check(c: structures.Check, check: StepCheck) -> None:
    c.errors, c.times, c.room = check.found.ctypes.data, check.times.ctypes.data, len(check.times)
    c.weights = check.weights.ctypes.data


def of_setter(setter: Setter, instance: InProcess, c: structures.Setter, memory: Memory) -> None:
    """Fills `c`."""
    c.place, c.n, c.key = ctypes.addressof(instance.place), len(setter.where), setter.key
    c.where, c.values = memory.copy(setter.where), setter.values.ctypes.data
    if setter.factors is not None and setter.offsets is not None:
        c.factors, c.offsets = setter.factors.ctypes.data, setter.offsets.ctypes.data
    if setter.into is not None:
        c.into, c.whole = setter.into.ctypes.data, setter.whole.ctypes.data
    c.sets = of_transfers(setter.transfers, instance, memory)
    c.n_sets = len(setter.transfers)
