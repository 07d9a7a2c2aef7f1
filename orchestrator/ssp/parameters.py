"""Parameter values of an SSP as start values of its FMUs (SSP 2.0, sections 5.3.3, 6 and 7).

A binding applies a parameter set to an element, by the names in the set with its `prefix`, or by
the names of its mapping if it has one. In a system, `connector` is its own connector, and
`element.name` is `name` in that element. Later bindings take precedence over earlier ones, those of
a system over those of its parts. A value is converted to the unit of its target and then
transformed.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from xml.etree.ElementTree import Element

from hapticlink.orchestrator.base.errors import SHOWN, InputFault
from hapticlink.orchestrator.base.terminal_output import printable
from hapticlink.orchestrator.fmi.units import SAME, Linear, Unit, conversion
from hapticlink.orchestrator.fmi.variables import CONTINUOUS, entry_of
from hapticlink.orchestrator.ssp.connections import ReachedVariable, Wires
from hapticlink.orchestrator.ssp.names import SSC, SSD, SSM, SSV
from hapticlink.orchestrator.ssp.tree import (
    Place,
    SsdElement,
    content,
    converts,
    indices,
    join_place,
    linear_of,
    table_of,
    units,
)

Value = bool | int | float | str
READ: dict[str, Callable[[str], Value]] = {
    **dict.fromkeys(CONTINUOUS, float),
    **dict.fromkeys(("Integer", *(f"{u}Int{n}" for u in ("", "U") for n in (8, 16, 32, 64))), int),
    "Boolean": lambda text: text in ("true", "1"),
    "String": str,
    "Binary": str,
    "Enumeration": str,
}


@dataclass(frozen=True)
class Given:
    """A parameter value and the name it is applied to: converted to the target's unit if `convert`,
    and then transformed by `linear`."""

    name: str
    value: Value
    unit: Unit | None
    linear: Linear = SAME
    convert: bool = True


@dataclass
class Parameters:
    """Reads the parameter bindings of the elements of `wires`."""

    wires: Wires
    unused: list[str] = field(default_factory=list)

    def starts(self) -> dict[Place, dict[str, Value]]:
        """Start values by component and variable. Values whose names match nothing are ignored, as
        SSP 1.0 requires, and logged. Raises InputFault for what cannot be read."""
        starts = self.values()
        if self.unused:
            names = printable(", ".join(self.unused[:SHOWN]))
            more = f" and {n} more" if (n := len(self.unused) - SHOWN) > 0 else ""
            message = "%s: parameters that match nothing are ignored: %s%s"
            logging.getLogger(__name__).warning(message, self.wires.path, names, more)
        return starts

    def values(self) -> dict[Place, dict[str, Value]]:
        """As `starts`; names that match nothing are in `unused`."""
        starts: dict[Place, dict[str, Value]] = {place: {} for place in self.wires.described}
        for part in self.wires.root:
            for given in self._given(part):
                targets = [*self._targets(part, given.name)]
                for target in targets:
                    value = self._converted(part, given, target)
                    starts[target.component][target.variable] = value
                if not targets:
                    self.unused.append(join_place(part.place, given.name))
        return starts

    def _given(self, part: SsdElement) -> Iterator[Given]:
        for file, binding in part.bindings:
            where = f"parameters of {join_place(part.place)}"
            set_ = content(file, binding, where, SSV, "ParameterSet")
            given = [
                *self._values(
                    {**file.units, **units(file.path, set_, SSV)}, set_, binding.get("prefix", "")
                )
            ]
            mapping = binding.find(f"{{{SSD}}}ParameterMapping")
            if mapping is not None:
                entries = content(file, mapping, where, SSM, "ParameterMapping")
                given = [*self._mapped(entries, given, part)]
            yield from given

    def _values(self, known: Mapping[str, Unit], set_: Element, prefix: str) -> Iterator[Given]:
        for parameter in set_.iterfind(f"{{{SSV}}}Parameters/{{{SSV}}}Parameter"):
            name, value = f"{prefix}{parameter.get('name')}", parameter[0]
            kind, unit = value.tag.removeprefix(f"{{{SSV}}}"), value.get("unit")
            of = known.get(unit, Unit(unit)) if unit else None
            given = [v.get("value", "") for v in value.iterfind(f"{{{SSV}}}Value")]
            sizes = [d.get("size") for d in parameter.iterfind(f"{{{SSC}}}Dimension")]
            given = given or value.get("value", "").split(None if sizes else "\0")
            entries = indices([int(n or len(given)) for n in sizes])
            try:
                for entry, text in zip(entries, given, strict=True):
                    yield Given(name + entry, READ[kind](text), of)
            except ValueError as error:  # also of a list for a scalar
                what = f"{len(given)} values for {len(entries)} entries, {error}"
                raise InputFault(f"{self.wires.path}: parameter {name}: {what}") from None

    def _mapped(
        self, mapping: Element, values: Iterable[Given], part: SsdElement
    ) -> Iterator[Given]:
        """The values of the set under the names that they are mapped to, those of an array entry by
        entry."""
        given: dict[str, list[Given]] = {}
        for value in values:
            for name in {value.name, entry_of(value.name)[0]}:
                given.setdefault(name, []).append(value)
        targets = set()
        for entry in mapping.iterfind(f"{{{SSM}}}MappingEntry"):
            source, target = entry.get("source", ""), entry.get("target", "")
            if target in targets:
                name = join_place(part.place, target)
                raise InputFault(
                    f"{self.wires.path}: two parameters are mapped to {name}; keep one"
                )
            targets.add(target)
            if source not in given:
                self.unused.append(join_place(part.place, source or f"source of {target}"))
                continue
            linear, convert = linear_of(entry), converts(entry)
            for value in given[source]:
                name = target + value.name.removeprefix(source)
                mapped = self._looked_up(entry, value)
                yield replace(value, name=name, value=mapped, linear=linear, convert=convert)

    def _looked_up(self, entry: Element, given: Given) -> Value:
        """The value after the mapping transformation of an entry, if it has one: unchanged where
        its table does not contain it. An enumeration goes by the names of its items."""
        if not (table := table_of(entry)):
            return given.value
        kind, targets = table
        as_kind = READ[kind]
        if type(given.value) is not type(as_kind("0")):
            what = f"{given.value!r} is no {kind}, of which its mapping has a table"
            raise InputFault(f"{self.wires.path}: parameter {given.name}: {what}")
        return {as_kind(a): as_kind(b) for a, b in targets.items()}.get(given.value, given.value)

    def _targets(self, part: SsdElement, name: str) -> Iterator[ReachedVariable]:
        """The variables that `name` refers to in `part`."""
        node = part.place, name
        if variable := self.wires.variables.get(node):
            yield ReachedVariable(part.place, name, self.wires.unit(node), SAME, variable.relative)
        yield from self.wires.reach.get(node, ())
        for inner in part.parts:
            if name.startswith(f"{inner.place[-1]}."):
                yield from self._targets(inner, name.removeprefix(f"{inner.place[-1]}."))

    def _converted(self, part: SsdElement, given: Given, target: ReachedVariable) -> Value:
        value, where = (
            given.value,
            f"{self.wires.path}: parameter {join_place(part.place, given.name)}",
        )
        try:
            first = SAME
            if given.convert:
                first = conversion(given.unit, target.unit, target.relative)
        except ValueError as error:
            raise InputFault(f"{where} does not fit: {error}; give it in another unit") from None
        linear = target.linear.after(given.linear.after(first))
        if linear == SAME:
            return value
        if isinstance(value, bool | str):
            raise InputFault(f"{where}: {value!r} is no number, so it cannot be scaled")
        return linear.factor * value + linear.offset
