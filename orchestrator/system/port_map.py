"""The ports of an FMU in the place of a block under the names that the block has for them: by the
scene's `map`, and where names differ in brackets, underscores or case alone."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

from hapticlink.orchestrator.base.errors import unknown
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.units import (
    MATRICES,
    SAME,
    Linear,
    Unit,
    conversion,
    why_unsuitable,
)
from hapticlink.orchestrator.fmi.variables import CONTINUOUS, Scalar

if TYPE_CHECKING:
    from hapticlink.components.component import Component, Variable
    from hapticlink.components.ports import Kind

_INDEX = re.compile(r"[\[(_ ]?(\d+(?:[,_]\d+)?)[\])]?$")
"""The index at the end of a name: F[1], F(1), F_1, F1, M[1,2], M_1_2."""
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_PRODUCT = re.compile(rf"(?P<sign>-?)\s*(?:(?P<before>{_NUMBER})\s*\*\s*)?"
                      rf"(?P<name>.*?)\s*(?:\*\s*(?P<after>{_NUMBER}))?", re.DOTALL)  # fmt: skip
_LISTED = re.compile(r"\{([^{},]+(?:,[^{},]+)*)\}")


class Term(NamedTuple):
    """An entry of a block's port is factor x, with x the FMU's scalar of this name."""

    name: str
    factor: float = 1.0

    def __str__(self) -> str:
        sign = {1.0: "", -1.0: "-"}.get(self.factor)
        return f"{self.factor!r}*{self.name}" if sign is None else sign + self.name


class UnfitMap(ValueError):
    """What a `map` gives for a port, and cannot be."""

    def __init__(self, port: str, why: object) -> None:
        super().__init__(str(why))
        self.port = port


Mapped = dict[str, tuple[Term, ...]]
"""By the block's port, what its entries are in the FMU, row by row."""


def map_ports(
    description: Description, block: Component, given: Mapping[str, str | tuple[str, ...]]
) -> Mapped:
    """What is called otherwise in an FMU than in the block that it replaces. Raises UnfitMap for
    a port or variable that there is not, and for a number of variables that is not the port's."""
    causes = {"input": block.inputs, "output": block.outputs, "parameter": block.parameters}
    ports = {v.name: (v, cause) for cause, variables in causes.items() for v in variables}
    renamings: Mapped = {}
    taken: set[str] = set()
    for port, names in given.items():
        if port not in ports:
            there = unknown("port of the block", port, ports)
            hint = "what it has with other settings alone is fed by a [[connection]]"
            raise UnfitMap(port, f"{there}; {hint}")
        try:
            renamings[port] = _renaming(description, *ports[port], names)
        except ValueError as fault:
            raise UnfitMap(port, fault) from fault
        for term in renamings[port]:
            if term.name in taken:
                raise UnfitMap(port, f"{term.name} is given twice")
            taken.add(term.name)
    for port, (variable, cause) in ports.items():
        taken = {term.name for terms in renamings.values() for term in terms}
        free = [s for s in description.scalars if s.causality == cause and s.name not in taken]
        if port not in renamings and not description.port(port, cause):
            left = [s for s in free if s.port not in ports]
            renamings |= {port: terms} if (terms := _alike(variable, left)) else {}
    return renamings


def _renaming(
    description: Description, port: Variable, causality: str, names: str | tuple[str, ...]
) -> tuple[Term, ...]:
    terms = tuple(_find_terms(description, names))
    if len(terms) != port.size:
        raise ValueError(f"{len(terms)} variables for the {port.size} entries of {port.name}")
    own = {s.name for s in description.scalars if port.name in (s.name, s.port)}
    if own - {term.name for term in terms}:
        raise ValueError(
            f"the FMU has a port {port.name} of its own: take {port.name} out of the map"
        )
    _check_factors(description, port, causality, terms)
    return terms


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
                    s = replace(_scaled(s, into), unit=unit.name)
                    units[unit.name] = unit
        scalars.append(s)
    return replace(description, scalars=tuple(scalars), units=units)


def rename_ports(description: Description, names: Mapped, block: Component) -> Description:
    """The description with the scalars of `names` under the block's names, and as what these are:
    an output is factor x, and an input gives x = input/factor, both in the FMU's unit."""
    every = {v.name: v for v in (*block.inputs, *block.outputs, *block.parameters)}
    new = {
        term.name: name
        for port, terms in names.items()
        for term, name in zip(terms, every[port].names, strict=True)
    }
    factors = {term.name: term.factor for terms in names.values() for term in terms}

    def renamed(dependencies: Mapping[str, frozenset[str]]) -> dict[str, frozenset[str]]:
        return {
            new.get(output, output): frozenset(new.get(name, name) for name in on)
            for output, on in dependencies.items()
        }

    def as_mapped(s: Scalar) -> Scalar:
        factor = factors.get(s.name, 1.0)
        own = Linear(factor if s.causality == "output" else 1.0 / factor)
        return replace(_scaled(s, own), name=new.get(s.name, s.name))

    return replace(
        description,
        scalars=tuple(map(as_mapped, description.scalars)),
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


def _scaled(s: Scalar, by: Linear) -> Scalar:
    """A scalar that is converted once more."""
    if by == SAME:
        return s
    size = abs(by.factor)
    bound = s.bound and size * s.bound
    return replace(s, conversion=by.after(s.conversion), bound=bound, nominal=size * s.nominal)


def _find_terms(description: Description, given: str | tuple[str, ...]) -> Iterator[Term]:
    """The terms that are written as names of variables or of whole vectors, each with a sign, a
    factor, or braces in it: `-tau_{x,y}`, `pos*0.001`, `1e-3*pos`. A variable that is called like
    that is meant itself. Raises ValueError."""
    for text in [given] if isinstance(given, str) else given:
        if _has(description, text):
            yield from _terms(description, text, 1.0)
            continue
        written = _PRODUCT.fullmatch(text)
        assert written is not None  # `name` takes whatever it is
        factor = float(f"{written['sign']}1")
        for number in written.group("before", "after"):
            factor *= float(number or 1)
        if not 0 < abs(factor) < math.inf:
            raise ValueError(f"{text}: a factor is a finite number other than 0")
        for name in _expand(written["name"]):
            if {*name} & {*"{}"}:
                raise ValueError(
                    f"{text}: a brace without its other, or an empty entry: write a list as "
                    "tau_{x,y,z}"
                )
            yield from _terms(description, name, factor)


def _terms(description: Description, name: str, factor: float) -> Iterator[Term]:
    there = [s for s in description.scalars if name in (s.name, s.port)]
    if not there:
        known = dict.fromkeys(s.port for s in description.scalars)
        more = re.search(r"[-+*/()]", name)
        hint = "; what is more than a sign and a factor is for a [[connection]]" if more else ""
        raise ValueError(unknown("variable of the FMU", name, known) + hint)
    yield from (Term(s.name, factor) for s in sorted(there, key=lambda s: s.indices))


def _has(description: Description, name: str) -> bool:
    return any(name in (s.name, s.port) for s in description.scalars)


def _expand(name: str) -> Iterator[str]:
    """`tau_x`, `tau_y` of `tau_{x,y}`."""
    if not (listed := _LISTED.search(name)):
        yield name
        return
    for each in listed[1].split(","):
        yield from _expand(name[: listed.start()] + each.strip() + name[listed.end() :])


def _check_factors(
    description: Description, port: Variable, causality: str, terms: Iterable[Term]
) -> None:
    """Raises ValueError for a factor that cannot be, or that would count twice."""
    scalars = {s.name: s for s in description.scalars}
    for term, unit in zip(terms, port.units, strict=True):
        if term.factor == 1.0:
            continue
        own = scalars[term.name]
        if causality == "parameter":
            raise ValueError(f"{port.name}: a parameter has no factor; `start` sets its value")
        if own.type not in CONTINUOUS:
            raise ValueError(f"{term}: {own.name} is {own.type}, and only a real number is scaled")
        if getattr(port, "kind", None) in MATRICES:
            raise ValueError(
                f"{term}: {port.name} is a {port.kind} matrix, whose entries are not scaled one by "
                "one; lead a [[connection]] with a factor from another FMU"
            )
        units = SAME
        with suppress(ValueError):  # told where it is connected
            units = conversion(description.unit(own), Unit.named(unit), own.relative)
        if units != SAME and math.isclose(abs(term.factor), abs(units.factor), rel_tol=1e-9):
            sign = "-" if term.factor < 0 else ""
            raise ValueError(
                f"{term}: {own.name} is in {own.unit} and is converted to {unit} by itself; "
                f"write {sign}{own.name}"
            )


def _alike(variable: Variable, scalars: Iterable[Scalar]) -> tuple[Term, ...]:
    """The scalars that are a port's entries by their names, counted from 1 or from 0; none where
    one lacks or there are more."""
    stem = _plain(variable.name)
    if not variable.shape:
        names = [s.name for s in scalars if _plain(s.name) == stem]
        return tuple(map(Term, names)) if len(names) == 1 else ()
    by_index: dict[tuple[int, ...], str] = {}
    for s in scalars:
        end = _INDEX.search(s.name)
        if end and _plain(s.name[: end.start()]) == stem:
            by_index[tuple(map(int, re.split("[,_]", end[1])))] = s.name
    for first in (1, 0):
        places = [*product(*(range(first, first + n) for n in variable.shape))]
        if sorted(by_index) == places:
            return tuple(Term(by_index[place]) for place in places)
    return ()


def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", name).lower()
