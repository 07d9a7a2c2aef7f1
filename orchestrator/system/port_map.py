"""The ports of an FMU in the place of a block under the names that the block has for them: by the
scene's `map`, and where names differ in brackets, underscores or case alone."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

from hapticlink.orchestrator.base.errors import unknown
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.units import SAME, Unit, conversion, why_unsuitable
from hapticlink.orchestrator.fmi.variables import Scalar

if TYPE_CHECKING:
    from hapticlink.components.component import Component, Variable
    from hapticlink.components.ports import Kind

_INDEX = re.compile(r"[\[(_ ]?(\d+(?:[,_]\d+)?)[\])]?$")
"""The index at the end of a name: F[1], F(1), F_1, F1, M[1,2], M_1_2."""
Mapped = dict[str, tuple[str, ...]]
"""By the block's port, the names of the FMU's scalars, row by row."""


def map_ports(
    description: Description, block: Component, given: Mapping[str, str | tuple[str, ...]]
) -> Mapped:
    """What is called otherwise in an FMU than in the block that it replaces. Raises ValueError for
    a port or variable that there is not, and for a number of variables that is not the port's."""
    causes = {"input": block.inputs, "output": block.outputs, "parameter": block.parameters}
    ports = {v.name: (v, cause) for cause, variables in causes.items() for v in variables}
    renamings: Mapped = {}
    for port, names in given.items():
        if port not in ports:
            there = unknown("port of the block", port, ports)
            hint = "what it has with other settings alone is fed by a [[connection]]"
            raise ValueError(f"{there}; {hint}")
        renamings[port] = tuple(s.name for s in _find_scalars(description, names))
        if len(renamings[port]) != (size := ports[port][0].size):
            raise ValueError(f"{len(renamings[port])} variables for the {size} entries of {port}")
        if {s.name for s in description.scalars if port in (s.name, s.port)} - {*renamings[port]}:
            raise ValueError(f"the FMU has a port {port} of its own: take {port} out of the map")
    every = [name for names in renamings.values() for name in names]
    if twice := [name for name in every if every.count(name) > 1]:
        raise ValueError(f"{twice[0]} is given twice")
    for port, (variable, cause) in ports.items():
        taken = {name for names in renamings.values() for name in names}
        free = [s for s in description.scalars if s.causality == cause and s.name not in taken]
        if port not in renamings and not description.port(port, cause):
            own = [s for s in free if s.port not in ports]
            renamings |= {port: names} if (names := _alike(variable, own)) else {}
    return renamings


def in_units_of(description: Description, block: Component) -> Description:
    """The description with outputs in the units of the block's that have their names, where the FMU
    has others: as they are read, so that whoever reads them finds what the block would have given.
    What cannot be converted stays as it is."""
    declared = {
        name: Unit.named(unit)
        for v in block.outputs
        for name, unit in zip(v.names, v.units, strict=True)
    }
    scalars, units = [], dict(description.units)
    for s in description.scalars:
        if s.causality == "output" and s.unit and (unit := declared.get(s.name)):
            with suppress(ValueError):
                into = conversion(description.unit(s), unit, s.relative)
                if into != SAME:
                    bound = s.bound and abs(into.factor) * s.bound
                    nominal = abs(into.factor) * s.nominal
                    s = replace(s, unit=unit.name, conversion=into, bound=bound, nominal=nominal)
                    units[unit.name] = unit
        scalars.append(s)
    return replace(description, scalars=tuple(scalars), units=units)


def rename_ports(description: Description, names: Mapped, block: Component) -> Description:
    """The description with the scalars of `names` under the block's names."""
    every = {v.name: v for v in (*block.inputs, *block.outputs, *block.parameters)}
    new = {
        own: name
        for port, given in names.items()
        for own, name in zip(given, every[port].names, strict=True)
    }

    def renamed(dependencies: Mapping[str, frozenset[str]]) -> dict[str, frozenset[str]]:
        return {
            new.get(output, output): frozenset(new.get(name, name) for name in on)
            for output, on in dependencies.items()
        }

    return replace(
        description,
        scalars=tuple(replace(s, name=new.get(s.name, s.name)) for s in description.scalars),
        dependencies=renamed(description.dependencies),
        initial_dependencies=renamed(description.initial_dependencies),
        derivatives={new.get(a, a): new.get(b, b) for a, b in description.derivatives.items()},
    )


def with_declarations(description: Description, block: Component) -> Description:
    """The description with what the block declares of its ports, where the FMU has ports of these
    names and sizes and declares nothing else: kinds, power ports and time derivatives."""

    def there(name: str, causality: str) -> tuple[Scalar, ...]:
        variable = next(v for v in (*block.inputs, *block.outputs) if v.name == name)
        entries = description.port(name, causality)
        return entries if len(entries) == variable.size else ()

    kinds: dict[str, Kind] = {}
    rates: dict[str, str] = {}
    for v in block.outputs:
        entries = there(v.name, "output")
        if (
            v.kind
            and entries
            and not why_unsuitable(v.kind, [description.unit(s) for s in entries])
        ):
            kinds[v.name] = v.kind
        if v.derivative_of:
            values = there(v.derivative_of, "output")
            rates |= {x.name: rate.name for x, rate in zip(values, entries, strict=False)}
    power = {
        v.name: v.power
        for v in block.inputs
        if v.power and there(v.name, "input") and there(v.power.displacement, "output")
    }
    return replace(
        description,
        kinds=kinds | dict(description.kinds),
        power=power | dict(description.power),
        derivatives=rates | dict(description.derivatives),
    )


def _find_scalars(description: Description, names: str | tuple[str, ...]) -> Iterator[Scalar]:
    """The scalars of names, each of a variable or of a whole vector. Raises ValueError."""
    for name in [names] if isinstance(names, str) else names:
        there = [s for s in description.scalars if name in (s.name, s.port)]
        if not there:
            known = dict.fromkeys(s.port for s in description.scalars)
            raise ValueError(unknown("variable of the FMU", name, known))
        yield from sorted(there, key=lambda s: s.indices)


def _alike(variable: Variable, scalars: Iterable[Scalar]) -> tuple[str, ...]:
    """The scalars that are a port's entries by their names, counted from 1 or from 0; none where
    one lacks or there are more."""
    stem = _plain(variable.name)
    if not variable.shape:
        names = [s.name for s in scalars if _plain(s.name) == stem]
        return tuple(names) if len(names) == 1 else ()
    by_index: dict[tuple[int, ...], str] = {}
    for s in scalars:
        end = _INDEX.search(s.name)
        if end and _plain(s.name[: end.start()]) == stem:
            by_index[tuple(map(int, re.split("[,_]", end[1])))] = s.name
    for first in (1, 0):
        places = [*product(*(range(first, first + n) for n in variable.shape))]
        if sorted(by_index) == places:
            return tuple(by_index[place] for place in places)
    return ()


def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", name).lower()
