"""The variables of a program: those of its blocks, `block.variable`, and what is measured of it.

Value references count [inputs | parameters | outputs | energies | step errors] from 0.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from hapticlink.components.base_units import BASES
from hapticlink.components.component import FRAME_SIZE, STEP_SIZE, Component
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.scalar_variables import ScalarVariable, scalar_variables
from hapticlink.fmus.units import base_unit
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


def ports(resolved: Resolved, components: Mapping[str, Component]) -> list[Port]:
    """The variables, in the order of their value references. components: of the members that are
    blocks of this project."""
    own = {fmu: [*_of_block(resolved, fmu, c)] for fmu, c in components.items()}
    every = [
        *_inputs(resolved, own),
        *_parameters(resolved, own),
        *_outputs(resolved, own),
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


def _of_block(resolved: Resolved, fmu: str, component: Component) -> Iterator[Port]:
    """All variables of a block of this project that no connection sets; step sizes are those of
    the scene."""
    set_by_others = {
        f"{fmu}.{name}" for name in (*fed(resolved.system, fmu), STEP_SIZE, FRAME_SIZE)
    }
    for reference, v in enumerate(scalar_variables(component)):
        of = v.derivative_of and f"{fmu}.{v.derivative_of}"
        depends = () if v.sampled else (f"{fmu}.{name}" for name in v.depends)
        free = tuple(name for name in depends if name not in set_by_others)
        named = {"name": f"{fmu}.{v.name}", "derivative_of": of, "depends": free}
        if named["name"] not in set_by_others:
            member = resolved.members.index(fmu)
            yield Port(**vars(v) | named, member=member, reference=reference)


def _inputs(resolved: Resolved, own: Mapping[str, Sequence[Port]]) -> Iterator[Port]:
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
        if fmu in resolved.foreign:
            yield from _settable(resolved, fmu, member, "input")
        else:
            yield from (port for port in own[fmu] if port.kind == "INPUT")


def _parameters(resolved: Resolved, own: Mapping[str, Sequence[Port]]) -> Iterator[Port]:
    for member, fmu in enumerate(resolved.members):
        if fmu in resolved.foreign:
            yield from _settable(resolved, fmu, member, "parameter")
            continue
        given = {f"{fmu}.{s.name}": float(v) for s, v in resolved.system.fmu[fmu].starts}
        for port in (port for port in own[fmu] if port.kind == "PARAMETER"):
            yield replace(port, start=given.get(port.name, port.start))


def _outputs(resolved: Resolved, own: Mapping[str, Sequence[Port]]) -> Iterator[Port]:
    """The outputs that the scene records, all by default."""
    signals, chosen = resolved.simulation.signals, resolved.recorded
    for member, fmu in enumerate(resolved.members):
        if fmu in resolved.foreign:
            yield from _foreign_outputs(resolved, fmu, member)
            continue
        there = {f"{fmu}.{s.name}" for s in resolved.system.fmu[fmu].description.outputs}
        for port in own[fmu]:
            if port.kind == "OUTPUT" and port.name in there & chosen:
                place = signals.scalar(fmu, port.name.removeprefix(f"{fmu}."))
                of = port.derivative_of if port.derivative_of in chosen else None
                yield replace(port, place=place, derivative_of=of)


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
