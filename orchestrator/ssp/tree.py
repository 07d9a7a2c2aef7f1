"""The elements of a SystemStructure.ssd as records: nested systems, components, connectors and
connections (SSP 2.0, chapter 5). Unsupported elements are errors."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from urllib.parse import unquote
from xml.etree.ElementTree import Element, fromstring

from lxml import etree

from hapticlink.components.base_units import BASES
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.units import SAME, Linear, Unit
from hapticlink.orchestrator.fmi.variables import MAX_NUMBERS
from hapticlink.orchestrator.ssp.names import FMU, SSC, SSD

Place = tuple[str, ...]
"""The names of the elements from the root system, (), down to this one."""
Node = tuple[Place, str]
"""A connector or variable: its element, and its name there."""


@dataclass(frozen=True)
class Connector:
    """A connector, as it is written. sizes: of the dimensions of an array, None for one that is
    left open; empty for a scalar."""

    kind: str
    unit: str | None
    sizes: tuple[int | None, ...] = ()


@dataclass(frozen=True)
class Line:
    """A connection as it is written, in either direction. The value is converted to the target's
    unit if `convert`, and then transformed by `linear`."""

    ends: tuple[Node, Node]
    linear: Linear
    convert: bool


@dataclass(frozen=True)
class Part:
    """A component, with `source` its FMU's entry in the archive; or a system, with `parts` and with
    `lines`, the connections between its own connectors and those of its parts."""

    place: Place
    connectors: Mapping[str, Connector]
    bindings: tuple[Element, ...]
    source: str | None = None
    parts: tuple[Part, ...] = ()
    lines: tuple[Line, ...] = ()

    def __iter__(self) -> Iterator[Part]:
        """All parts, each after the parts inside it, and finally this one."""
        for part in self.parts:
            yield from part
        yield self


def dotted(place: Place, *names: str) -> str:
    """The hierarchical name in the notation of SSP 1.0 parameters."""
    return ".".join((*place, *names)) or "the root system"


def checked(path: Path, entry: str, text: bytes, schema: str) -> Element:
    """The XML tree of `text`. Raises InputFault unless it conforms to the schema of SSP 2.0, whose
    elements and namespaces include those of 1.0."""
    try:
        root = etree.fromstring(text)
        if (version := root.get("version", "")).partition(".")[0] in ("1", "2"):
            root.set("version", f"{version[0]}.0")  # also of 1.0.1 and drafts
        _schema(schema).assertValid(root)
    except (etree.LxmlError, ValueError) as error:
        what = f"{path}: {entry} is no SSP 1.0 or 2.0 ({schema})"
        raise InputFault(f"{what}: {str(error)[:300]}") from error
    return fromstring(text)


@cache
def _schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(file=str(Path(__file__).parent / "schema" / f"{name}.xsd"))


def units(root: Element, space: str = SSD) -> dict[str, Unit]:
    """The units that a file defines, by name."""
    units = {}
    for unit in root.iterfind(f"{{{space}}}Units/{{{SSC}}}Unit"):
        base = unit.find(f"{{{SSC}}}BaseUnit")
        assert base is not None  # required by the schema
        powers = tuple(int(base.get(b, "0")) for b in BASES)
        factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
        units[unit.get("name", "")] = Unit(unit.get("name", ""), powers, factor, offset)
    return units


def tree(path: Path, element: Element, place: Place = ()) -> Part:
    """The part of a System or Component element, with all parts inside it. Raises InputFault for
    elements that are not supported and for names that are not unique."""
    kind, where = element.tag.removeprefix(f"{{{SSD}}}"), dotted(place)
    connectors = {
        c.get("name", ""): _connector(path, place, c)
        for c in element.iterfind(f"{{{SSD}}}Connectors/{{{SSD}}}Connector")
    }
    bindings = (*element.iterfind(f"{{{SSD}}}ParameterBindings/{{{SSD}}}ParameterBinding"),)
    if kind == "Component":
        type_, how = element.get("type", FMU), element.get("implementation", "CoSimulation")
        source = element.get("source")
        if type_ == FMU and how == "CoSimulation" and source:
            return Part(place, connectors, bindings, unquote(source).removeprefix("./"))
        kind += f" of type {type_}" if type_ != FMU else f" for {how}" if source else " without FMU"
    if kind != "System":
        raise InputFault(
            f"{path}: {where} is a {kind}; supported are systems, and components that are FMUs for "
            "co-simulation: put the system of another file into this one, and connect signals one "
            "by one"
        )
    names = [e.get("name", "") for e in element.iterfind(f"{{{SSD}}}Elements/*")]
    if twice := {n for n, count in Counter(names).items() if count > 1}:
        raise InputFault(f"{path}: {where} has two elements named {min(twice)!r}: name each once")
    parts = (
        tree(path, e, (*place, name))
        for e, name in zip(element.iterfind(f"{{{SSD}}}Elements/*"), names, strict=True)
    )
    lines = (
        _line(path, place, c) for c in element.iterfind(f"{{{SSD}}}Connections/{{{SSD}}}Connection")
    )
    return Part(place, connectors, bindings, parts=tuple(parts), lines=tuple(lines))


def _connector(path: Path, place: Place, element: Element) -> Connector:
    kind, name = element.get("kind", ""), dotted(place, element.get("name", ""))
    if kind in ("inout", "unspecified"):
        raise InputFault(f"{path}: {name} is {kind}; give its kind as input or output")
    unit = next((e.get("unit") for e in element if e.get("unit")), None)
    sizes = (d.get("size") for d in element.iterfind(f"{{{SSC}}}Dimension"))
    return Connector(kind, unit, tuple(int(size) if size else None for size in sizes))


def indices(sizes: Sequence[int | None]) -> list[str]:
    """The indices of all entries of an array row by row, as "[1,1]", "[1,2]" ...; [""] of a
    scalar, [] where a size is left open. Raises InputFault for more than MAX_NUMBERS entries."""
    if None in sizes:
        return []
    if math.prod(size or 0 for size in sizes) > MAX_NUMBERS:
        raise InputFault(f"an array of the sizes {sizes}; at most {MAX_NUMBERS} entries")
    every = product(*(range(1, 1 + (size or 0)) for size in sizes))
    return [f"[{','.join(map(str, entry))}]" if entry else "" for entry in every]


def _line(path: Path, place: Place, element: Element) -> Line:
    def node(end: str) -> Node:
        inside, name = element.get(f"{end}Element"), element.get(f"{end}Connector", "")
        if indices := element.get(f"{end}Indices", "").split():  # from 1, by its authors' examples
            name += f"[{','.join(indices)}]"
        return (*place, inside) if inside else place, name

    ends = (node("start"), node("end"))
    names = " and ".join(dotted(*end) for end in ends)
    linear = transformation(path, f"the connection of {names}", element)
    return Line(ends, linear, converts(element))


def transformation(path: Path, where: str, element: Element) -> Linear:
    """The linear transformation of a connection or mapping. Raises InputFault for mapping
    transformations, which are tables of values."""
    for child in element:
        if child.tag == f"{{{SSC}}}LinearTransformation":
            return Linear(float(child.get("factor", "1")), float(child.get("offset", "0")))
        if child.tag.endswith("MappingTransformation"):
            name = child.tag.removeprefix(f"{{{SSC}}}")
            raise InputFault(f"{path}: {where}: {name} is not read; put its table into an FMU")
    return SAME


def converts(element: Element) -> bool:
    """Whether a connection or mapping converts units."""
    return element.get("suppressUnitConversion") not in ("true", "1")
