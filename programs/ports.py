"""The variables of a program: those of its blocks, `block.variable`, and what is measured of it.

Value references count [inputs | parameters | outputs | energies | step errors] from 0.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Literal

from hapticlink.components.base_units import BASES
from hapticlink.components.component import FRAME_SIZE, STEP_SIZE, Component, Variable
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.model_description import feed_through, scalars
from hapticlink.fmus.units import base_unit
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.units import Unit
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.system.system import System
from hapticlink.programs.resolve_scene import Resolved

Kind = Literal["INPUT", "OUTSIDE", "PARAMETER", "OUTPUT", "ENERGY", "STEP_ERROR"]


@dataclass(frozen=True)
class Port:
    """A scalar variable of the program."""

    kind: Kind
    """INPUT, PARAMETER and OUTPUT are a block's; OUTSIDE is an output of the block that is left
    out, and thus an input."""
    name: str
    unit: str
    description: str
    member: int = 0
    """Index of its block among the members, of an energy that of its meter."""
    reference: int = 0
    """Its value reference in that block."""
    place: int = -1
    """Its index in the signal vector."""
    start: float | None = None
    fixed: bool = False
    """A parameter that is set before the run only."""
    max: float | None = None
    sampled: bool = False
    """Of an output: changes at the steps of its block only."""
    derivative_of: str | None = None
    """The output of the program of which it is the time derivative."""
    depends: tuple[str, ...] = field(default=())
    """The inputs of the program that an output depends on at a communication point."""
    shape: tuple[int, ...] = ()
    """That of the vector or matrix of which it is an entry."""
    type: str = "Real"
    """What it is in its block: Real, Integer or Boolean; here all are numbers."""
    defined: Unit | None = None
    """Its unit where an FMU of others defines it; "" has none."""
    is_set: bool = True
    """Whether its start value is set, which an FMU of others may have by itself."""


@dataclass(frozen=True)
class Array:
    """A variable of FMI 3.0, whose entries are scalars of the program, row by row."""

    name: str
    shape: tuple[int, ...]
    reference: int
    """That of the first entry among the scalars."""
    entries: tuple[Port, ...]


def arrays(ports: Sequence[Port]) -> Iterator[Array]:
    """The scalars as variables of FMI 3.0: vectors and matrices whole, but for those of which not
    all entries are there."""
    reference = 0
    for (_, name), group in groupby(ports, key=lambda p: (p.kind, p.name.partition("[")[0])):
        entries = tuple(group)
        shape = entries[0].shape
        if shape and math.prod(shape) == len(entries):
            yield Array(name, shape, reference, entries)
        else:
            for i, port in enumerate(entries, reference):
                yield Array(port.name, (), i, (port,))
        reference += len(entries)


def ports(resolved: Resolved, components: Mapping[str, Component]) -> list[Port]:
    """The variables, in the order of their value references. components: of the members that are
    blocks of this project."""
    every = [
        *_inputs(resolved, components),
        *_parameters(resolved, components),
        *_outputs(resolved, components),
        *_energies(resolved),
        *_step_errors(resolved),
    ]
    units: dict[str, Unit | None] = {}
    return [
        port if units.setdefault(port.unit, port.defined) == port.defined else
        replace(port, unit="", defined=None)
        for port in every
    ]  # fmt: skip


def fed(system: System, fmu: str) -> set[str]:
    """The scalars of an FMU that connections set."""
    return {s.name for c in system.connections if c.target == fmu for s in c.inputs}


def _inputs(resolved: Resolved, components: Mapping[str, Component]) -> Iterator[Port]:
    if resolved.outside:
        span = resolved.simulation.signals.fmu(resolved.outside)
        outputs = resolved.system.fmu[resolved.outside].description.outputs
        used = {s.name for c in resolved.system.out_of(resolved.outside) for s in c.outputs}
        values = resolved.simulation.signals.values[span].tolist()
        names = {s.port: s.name for s in outputs}  # of the last entry
        for place, (scalar, start) in enumerate(zip(outputs, values, strict=True), span.start):
            if scalar.name in used:
                name = f"{resolved.outside}.{scalar.name}"
                unit, defined = _unit(resolved.system.fmu[resolved.outside].description, scalar)
                text = f"{scalar.port} of the {resolved.outside}, which is left out."
                last = names[scalar.port].removeprefix(scalar.port)
                shape = tuple(map(int, re.findall(r"\d+", last)))
                yield Port(
                    "OUTSIDE", name, unit, text, place=place, start=start, shape=shape,
                    defined=defined,
                )  # fmt: skip
    for member, fmu in enumerate(resolved.members):
        taken = fed(resolved.system, fmu)
        if fmu in resolved.foreign:
            yield from _settable(resolved, fmu, member, "input")
            continue
        component = components[fmu]
        for reference, (v, name, unit, start) in enumerate(scalars(component.inputs)):
            if name not in taken:
                yield Port(
                    "INPUT", f"{fmu}.{name}", unit, v.description, member, reference, start=start,
                    shape=v.shape,
                )  # fmt: skip


def _parameters(resolved: Resolved, components: Mapping[str, Component]) -> Iterator[Port]:
    """Parameters that no connection sets; step sizes are those of the scene."""
    for member, fmu in enumerate(resolved.members):
        if fmu in resolved.foreign:
            yield from _settable(resolved, fmu, member, "parameter")
            continue
        component = components[fmu]
        taken = fed(resolved.system, fmu) | {STEP_SIZE, FRAME_SIZE}
        first = len(component.start_inputs)
        given = dict((s.name, float(v)) for s, v in resolved.system.fmu[fmu].starts)
        for reference, (v, name, unit, start) in enumerate(scalars(component.parameters), first):
            if name in taken:
                continue
            yield Port(
                "PARAMETER", f"{fmu}.{name}", unit, v.description, member, reference,
                start=given.get(name, start), fixed=v.variability == "fixed", shape=v.shape,
            )  # fmt: skip


def _outputs(resolved: Resolved, components: Mapping[str, Component]) -> Iterator[Port]:
    """The outputs that the scene records, all by default."""
    signals, chosen = resolved.simulation.signals, resolved.recorded
    for member, fmu in enumerate(resolved.members):
        if fmu in resolved.foreign:
            yield from _foreign_outputs(resolved, fmu, member)
            continue
        component = components[fmu]
        places = {s.name: s.reference for s in resolved.system.fmu[fmu].description.outputs}
        taken, through = fed(resolved.system, fmu), feed_through(component)
        inputs = [name for _, name, _, _ in scalars(component.inputs)]
        first = len(component.start_inputs) + len(component.start_parameters)
        sampled, bases = component.timing == "sampled", _bases(component)
        for i, (v, name, unit, _) in enumerate(scalars(component.outputs)):
            if name not in places or f"{fmu}.{name}" not in chosen:
                continue
            depends = () if sampled else tuple(inputs[k] for k in through[i])
            of = bases.get(name)
            yield Port(
                "OUTPUT", f"{fmu}.{name}", unit, v.description, member, first + i,
                signals.scalar(fmu, name), max=v.max, sampled=sampled,
                derivative_of=f"{fmu}.{of}" if of and f"{fmu}.{of}" in chosen else None,
                depends=tuple(f"{fmu}.{u}" for u in depends if u not in taken), shape=v.shape,
            )  # fmt: skip


def _settable(resolved: Resolved, fmu: str, member: int, causality: str) -> Iterator[Port]:
    """The real inputs or parameters of an FMU of others that no connection sets."""
    description, taken = resolved.foreign[fmu].description, fed(resolved.system, fmu)
    given = {s.name: float(v) for s, v in resolved.system.fmu[fmu].starts if s.type == "Real"}
    for s in description.scalars:
        if s.causality != causality or s.type != "Real" or not s.settable or s.name in taken:
            continue
        unit, defined = _unit(description, s)
        yield Port(
            "INPUT" if causality == "input" else "PARAMETER", f"{fmu}.{s.name}", unit,
            f"{s.name} of {description.path.name}.", member, s.reference,
            start=given.get(s.name, s.start), fixed=s.variability == "fixed", defined=defined,
            is_set=s.name in given,
        )  # fmt: skip


def _foreign_outputs(resolved: Resolved, fmu: str, member: int) -> Iterator[Port]:
    description, signals = resolved.foreign[fmu].description, resolved.simulation.signals
    taken = fed(resolved.system, fmu)
    inputs = [s for s in description.scalars if s.causality == "input" and s.type == "Real"]
    free = [s for s in inputs if s.name not in taken]
    for s in description.outputs:
        if f"{fmu}.{s.name}" not in resolved.recorded:
            continue
        unit, defined = _unit(description, s)
        sampled = description.timing == "sampled"
        yield Port(
            "OUTPUT", f"{fmu}.{s.name}", unit, f"{s.name} of {description.path.name}.", member,
            s.reference, signals.scalar(fmu, s.name), sampled=sampled or s.type != "Real",
            depends=() if sampled
            else tuple(f"{fmu}.{u.name}" for u in free if description.follows(s, [u])),
            type=s.type, defined=defined,
        )  # fmt: skip


def _unit(description: Description, scalar: Scalar) -> tuple[str, Unit | None]:
    """The unit of a variable: its name, and what it is where that is not what it says."""
    unit = description.unit(scalar)
    if unit is None or description.block is not None:
        return scalar.unit or ("" if description.block is None else "1"), None
    try:
        powers = tuple(base_unit(unit.name).get(base, 0) for base in BASES)
    except FmuError:
        powers = None
    return unit.name, None if unit == Unit(unit.name, powers) and powers else unit


def _bases(component: Component) -> dict[str, str]:
    """By name of an output, that of which it is the time derivative."""
    outputs: dict[str, Variable] = {v.name: v for v in component.outputs}
    by_output: dict[str, str] = {}
    for v in component.outputs:
        if v.derivative_of:
            by_output |= dict(zip(v.names, outputs[v.derivative_of].names, strict=True))
    return by_output


def _energies(resolved: Resolved) -> Iterator[Port]:
    for index, connection in enumerate(resolved.meters):
        c = resolved.system.connection[connection]
        text = f"Energy that sampling and holding {connection} has generated."
        yield Port("ENERGY", f"energy.{c.target}.{c.target_port}", "J", text, index)


def _step_errors(resolved: Resolved) -> Iterator[Port]:
    for fmu in _checked(resolved):
        text = f"Estimated sum of the relative errors of the steps of {fmu}, by step doubling."
        index = resolved.fmus.index(fmu)
        yield Port("STEP_ERROR", f"step_error.{fmu}", "1", text, index)


def _checked(resolved: Resolved) -> Sequence[str]:
    checks = resolved.simulation.step_checks
    return [fmu for fmu in resolved.members if fmu in checks]
