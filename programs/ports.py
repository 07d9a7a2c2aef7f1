"""The variables of a program: those of its blocks, `block.variable`, and what is measured of it.

Value references count [inputs | parameters | outputs | energies | step errors] from 0.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from hapticlink.components.component import Component
from hapticlink.components.ports import FRAME_SIZE, STEP_SIZE
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.scalar_variables import ScalarVariable, scalar_variables
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.units import Unit
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.system.system import System
from hapticlink.programs.resolve_scene import Resolved


@dataclass(frozen=True)
class Port(ScalarVariable):
    """A scalar variable of the program. kind: INPUT, PARAMETER and OUTPUT are a block's; OUTSIDE is
    an output of the block that is left out, and thus an input; ENERGY and STEP_ERROR are
    measured."""

    member: int = 0
    """Index of its block among the members, of an energy that of its meter."""
    reference: int = 0
    """Its value reference in that block."""
    place: int = -1
    """Its index in the signal vector."""
    type: str = "Real"
    """What it is in its block: Real, Integer or Boolean; here all are numbers."""
    defined: Unit | None = None
    """Its unit where an FMU of others defines it; "" has none."""
    is_set: bool = True
    """Whether its start value is set, which an FMU of others may have by itself."""

    @property
    def causality(self) -> str:
        others = {"OUTSIDE": "input", "ENERGY": "local", "STEP_ERROR": "local"}
        return others.get(self.kind, self.kind.lower())


KINDS = ("OUTSIDE", "INPUT", "PARAMETER", "OUTPUT", "ENERGY", "STEP_ERROR")
"""In the order of their value references."""


def ports(resolved: Resolved, components: Mapping[str, Component]) -> list[Port]:
    """The variables, in the order of their value references. components: of the members that are
    blocks of this project."""
    every = [*_outside(resolved), *_energies(resolved), *_step_errors(resolved)]
    for member, fmu in enumerate(resolved.members):
        if fmu in resolved.foreign:
            every += _of_others(resolved, fmu, member)
        else:
            every += _of_block(resolved, fmu, member, components[fmu])
    every.sort(key=lambda port: KINDS.index(port.kind))
    units: dict[str, Unit | None] = {}
    return [
        port if units.setdefault(port.unit, port.defined) == port.defined else
        replace(port, unit="", defined=None)
        for port in every
    ]  # fmt: skip


def find_fed(system: System, fmu: str) -> set[str]:
    """The scalars of an FMU that connections set."""
    return {s.name for c in system.connections if c.target == fmu for s in c.inputs}


def _of_block(resolved: Resolved, fmu: str, member: int, component: Component) -> Iterator[Port]:
    """The variables of a block of this project that no connection sets, of its outputs those that
    the scene records (all by default); step sizes are those of the scene."""
    system = resolved.system
    set_by_others = {f"{fmu}.{name}" for name in (*find_fed(system, fmu), STEP_SIZE, FRAME_SIZE)}
    chosen = {f"{fmu}.{s.name}" for s in system.fmu[fmu].description.outputs} & resolved.recorded
    given = {s.name: float(v) for s, v in system.fmu[fmu].starts}
    for reference, v in enumerate(scalar_variables(component)):
        name, of = f"{fmu}.{v.name}", f"{fmu}.{v.derivative_of}"
        if name in set_by_others or (v.kind == "OUTPUT" and name not in chosen):
            continue
        depends = () if v.sampled else (f"{fmu}.{name}" for name in v.depends)
        own: dict[str, Any] = {
            "name": name,
            "derivative_of": of if of in resolved.recorded else None,
            "depends": tuple(name for name in depends if name not in set_by_others),
        }
        if v.kind == "PARAMETER":
            own["start"] = given.get(v.name, v.start)
        if v.kind == "OUTPUT":
            own["place"] = resolved.simulation.signals.scalar(fmu, v.name)
        yield Port(**vars(v) | own, member=member, reference=reference)


def _outside(resolved: Resolved) -> Iterator[Port]:
    """The outputs of the block that is left out which connections need."""
    if not resolved.outside:
        return
    span = resolved.simulation.signals.fmu(resolved.outside)
    description = resolved.system.fmu[resolved.outside].description
    used = {s.name for c in resolved.system.out_of(resolved.outside) for s in c.outputs}
    values = resolved.simulation.signals.values[span].tolist()
    names = {s.port: s.name for s in description.outputs}  # of the last entry
    for place, (scalar, start) in enumerate(
        zip(description.outputs, values, strict=True), span.start
    ):
        if scalar.name in used:
            unit, defined = _unit(description, scalar)
            last = names[scalar.port].removeprefix(scalar.port)
            yield Port(
                "OUTSIDE",
                f"{resolved.outside}.{scalar.name}",
                unit,
                f"{scalar.port} of the {resolved.outside}, which is left out.",
                place=place,
                start=start,
                shape=tuple(map(int, re.findall(r"\d+", last))),
                defined=defined,
            )


def _of_others(resolved: Resolved, fmu: str, member: int) -> Iterator[Port]:
    """The real inputs and parameters of an FMU of others that no connection sets, and its outputs
    that the scene records."""
    description, taken = resolved.foreign[fmu].description, find_fed(resolved.system, fmu)
    given = {s.name: float(v) for s, v in resolved.system.fmu[fmu].starts if s.type == "Real"}
    real = [s for s in description.scalars if s.type == "Real" and s.name not in taken]
    inputs = [s for s in real if s.causality == "input"]
    sampled = description.timing == "sampled"

    def port(s: Scalar, **known: Any) -> Port:
        unit, defined = _unit(description, s)
        name, text = f"{fmu}.{s.name}", f"{s.name} of {description.path.name}."
        kind = s.causality.upper()
        return Port(kind, name, unit, text, member, s.reference, defined=defined, **known)

    for s in (s for s in real if s.causality in ("input", "parameter") and s.settable):
        fixed, start = s.variability == "fixed", given.get(s.name, s.start)
        yield port(s, start=start, fixed=fixed, is_set=s.name in given)
    for s in (s for s in description.outputs if f"{fmu}.{s.name}" in resolved.recorded):
        known = () if sampled else (u for u in inputs if description.follows(s, [u]))
        yield port(
            s,
            place=resolved.simulation.signals.scalar(fmu, s.name),
            sampled=sampled or s.type != "Real",
            depends=tuple(f"{fmu}.{u.name}" for u in known),
            type=s.type,
        )


def _unit(description: Description, scalar: Scalar) -> tuple[str, Unit | None]:
    """The unit of a variable: its name, and what it is where that is not what it says."""
    unit = description.unit(scalar)
    if unit is None or description.block is not None:
        return scalar.unit or ("" if description.block is None else "1"), None
    with suppress(FmuError):
        if unit == Unit.named(unit.name):
            return unit.name, None
    return unit.name, unit


def _energies(resolved: Resolved) -> Iterator[Port]:
    for index, connection in enumerate(resolved.meters):
        c = resolved.system.connection[connection]
        text = f"Energy that sampling and holding {connection} has generated."
        yield Port("ENERGY", f"energy.{c.to}", "J", text, index)


def _step_errors(resolved: Resolved) -> Iterator[Port]:
    for fmu in (m for m in resolved.members if m in resolved.simulation.step_checks):
        text = f"Estimated sum of the relative errors of the steps of {fmu}, by step doubling."
        index = resolved.fmus.index(fmu)
        yield Port("STEP_ERROR", f"step_error.{fmu}", "1", text, index)
