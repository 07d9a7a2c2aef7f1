"""The elements of a SystemStructure.ssd as records: nested systems, components, connectors,
connections and signal dictionaries (SSP 2.0, chapter 5). Unsupported elements are errors."""

from __future__ import annotations

import math
import posixpath
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree.ElementTree import Element, fromstring, tostring

from lxml import etree

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi import variables
from hapticlink.orchestrator.fmi.archive import (
    MAX_BYTES,
    MAX_XML_BYTES,
    open_archive,
    read_xml,
)
from hapticlink.orchestrator.fmi.units import SAME, Linear, Unit
from hapticlink.orchestrator.ssp.names import DEFINITION, FMU, PACKAGE, SSB, SSC, SSD, STRUCTURE

Place = tuple[str, ...]
"""The names of the elements from the root system, (), down to this one."""
Node = tuple[Place, str]
"""A connector or variable: its element, and its name there."""


DEEPEST = 32
"""Systems in systems in which a component may be a file with further ones."""


MOST_FILES, MOST_PARTS = 1000, 100_000
"""Files in files of a document, and its systems, components and dictionaries, each as often as it
is named: two files that name each other twice double with each level."""


@dataclass
class DocumentSize:
    """What an SSP has unfolded to so far: files in files, parts, bytes of XML, and bytes of
    archives in archives."""

    files: int = 0
    parts: int = 0
    xml: int = 0
    archives: int = 0

    def grow(self, path: Path, **more: int) -> None:
        """Add to it. Raises InputFault beyond a bound."""
        bounds = {
            "files": (MOST_FILES, "files in files"),
            "parts": (MOST_PARTS, "systems and components"),
            "xml": (MAX_XML_BYTES, "bytes of XML"),
            "archives": (MAX_BYTES, "bytes in archives in it"),
        }
        for name, count in more.items():
            setattr(self, name, total := getattr(self, name) + count)
            most, what = bounds[name]
            if total > most:
                raise InputFault(
                    f"{path}: the document has more than {most} {what}, counted as often as they "
                    "are named: name each file in fewer places, or split the document"
                )


@dataclass(frozen=True)
class File:
    """An .ssd, an entry of an archive, with the units that it defines. path: for errors, of the
    archive, or of its place in another one. size: of the document that it belongs to."""

    path: Path
    archive: zipfile.ZipFile
    entry: str = STRUCTURE
    units: Mapping[str, Unit] = field(default_factory=dict)
    size: DocumentSize = field(default_factory=DocumentSize, compare=False)

    def read_entry(self, entry: str) -> bytes:
        """An XML entry of the archive, as `read_xml`."""
        text = read_xml(self.archive, entry)
        self.size.grow(self.path, xml=len(text))
        return text

    def resolved(self, source: str) -> str:
        """The entry of the archive that a relative URI refers to."""
        return posixpath.normpath(posixpath.join(posixpath.dirname(self.entry), unquote(source)))


@dataclass(frozen=True)
class Connector:
    """A connector, as it is written. sizes: of the dimensions of an array, None for one that is
    left open; empty for a scalar."""

    kind: str
    unit: Unit | None
    sizes: tuple[int | None, ...] = ()


@dataclass(frozen=True)
class SsdConnection:
    """A connection as it is written, in either direction. The value is converted to the target's
    unit if `convert`, and then transformed by `linear`."""

    ends: tuple[Node, Node]
    linear: Linear
    convert: bool


IMPLEMENTATIONS = {"any": None, "CoSimulation": None, "ModelExchange": "model-exchange"}
"""The interface of an FMU by the attribute `implementation` of its component."""


@dataclass(frozen=True)
class SsdElement:
    """A component, with `source` its FMU's file and entry and `interface` that by which it is run,
    None for the one that the FMU has first; or a system, with `parts` and with
    `lines`, the connections between its own connectors and those of its parts. bindings: its
    parameter bindings, each with the file that it is in. A reference to a signal dictionary is a
    system without parts; dictionary: the place of that."""

    place: Place
    connectors: Mapping[str, Connector]
    bindings: tuple[tuple[File, Element], ...]
    source: tuple[File, str] | None = None
    interface: str | None = None
    parts: tuple[SsdElement, ...] = ()
    lines: tuple[SsdConnection, ...] = ()
    dictionary: Place | None = None

    def everywhere(self, **changes: Any) -> SsdElement:
        """The part with these fields changed, in all parts inside it, too."""
        inside = tuple(part.everywhere(**changes) for part in self.parts)
        return replace(self, parts=inside, **changes)

    def __iter__(self) -> Iterator[SsdElement]:
        """All parts, each after the parts inside it, and finally this one."""
        for part in self.parts:
            yield from part
        yield self


@dataclass(frozen=True)
class Dictionary:
    """A signal dictionary: its place, and the unit of each entry."""

    place: Place
    units: Mapping[str, Unit | None]


def join_place(place: Place, *names: str) -> str:
    """The hierarchical name in the notation of SSP 1.0 parameters."""
    return ".".join((*place, *names)) or "the root system"


def parse_xml(path: Path, entry: str, text: bytes, schema: str) -> Element:
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


CONTENT_TYPES = {
    "ParameterSet": "application/x-ssp-parameter-set",
    "ParameterMapping": "application/x-ssp-parameter-mapping",
    "SignalDictionary": "application/x-ssp-signal-dictionary",
}


def content(file: File, element: Element, where: str, space: str, kind: str) -> Element:
    """The `kind` of content inside an element, or in the file that it names. Raises InputFault for
    content of another type, and where there is none."""
    if element.get("type", CONTENT_TYPES[kind]) != CONTENT_TYPES[kind]:
        raise InputFault(f"{file.path}: {where}: type {element.get('type')} is not read")
    if element.get("sourceBase") == "component":
        raise InputFault(
            f"{file.path}: {where}: {element.get('source')} is inside an FMU, where it is "
            "not read; put it beside the .ssd"
        )
    entry, schema = element.get("source"), space.rpartition("/")[2]
    if entry:
        entry = file.resolved(entry)
        return parse_xml(file.path, entry, file.read_entry(entry), schema)
    inside = next(element.iter(f"{{{space}}}{kind}"), None)
    if inside is None:
        raise InputFault(f"{file.path}: {where}: a {kind} has neither source nor content")
    inside.attrib.setdefault("version", "1.0")  # OMSimulator writes none in the .ssd
    return parse_xml(file.path, where, tostring(inside), schema)


@cache
def _schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(file=str(Path(__file__).parent / "schema" / f"{name}.xsd"))


def units(path: Path, root: Element, space: str = SSD) -> dict[str, Unit]:
    """The units that a file defines, by name. Raises InputFault for one that measures nothing."""
    every = root.iterfind(f"{{{space}}}Units/{{{SSC}}}Unit")
    try:
        return {unit.name: unit for unit in (Unit.read(e, f"{{{SSC}}}") for e in every)}
    except ValueError as why:
        raise InputFault(f"{path}: {why}") from None


@dataclass(frozen=True)
class Tree:
    """Reads .ssd files. archives: keeps those open that are in another one."""

    archives: ExitStack

    def root(self, file: File, place: Place = ()) -> tuple[Element, SsdElement]:
        """The content of an .ssd, and its root system as the element at `place`."""
        text = file.read_entry(file.entry)
        root = parse_xml(file.path, file.entry, text, "SystemStructureDescription")
        element = root.find(f"{{{SSD}}}System")
        assert element is not None  # required by the schema
        return root, self._part(replace(file, units=units(file.path, root)), element, place, {})

    def _part(
        self, file: File, element: Element, place: Place, known: Mapping[str, Dictionary]
    ) -> SsdElement:
        """The part of an element of a system, with all parts inside it. known: the dictionaries of
        the systems around it. Raises InputFault for elements that are not supported and for names
        that are not unique."""
        path, where = file.path, join_place(place)
        file.size.grow(path, parts=1)
        connectors = {
            c.get("name", ""): _connector(file, place, c)
            for c in element.iterfind(f"{{{SSD}}}Connectors/{{{SSD}}}Connector")
        }
        bound = element.iterfind(f"{{{SSD}}}ParameterBindings/{{{SSD}}}ParameterBinding")
        bindings = tuple((file, binding) for binding in bound)
        if element.tag == f"{{{SSD}}}SignalDictionaryReference":
            return _reference(file, element, place, connectors, known)
        if element.tag != f"{{{SSD}}}System":
            source = file, file.resolved(_source_of(path, where, element))
            if element.get("type", FMU) == FMU:
                how = IMPLEMENTATIONS[element.get("implementation", "any")]
                return SsdElement(place, connectors, bindings, source, how)
            system = self._inner(*source, element, place)
            return replace(system, bindings=(*system.bindings, *bindings))
        inside = [*element.iterfind(f"{{{SSD}}}Elements/*")]
        names = [e.get("name", "") for e in inside]
        if twice := {n for n, count in Counter(names).items() if count > 1}:
            what = f"{where} has two elements named {min(twice)!r}"
            raise InputFault(f"{path}: {what}: name each once")
        known = {**known, **_dictionaries(file, element, place)}
        parts = (self._part(file, e, (*place, e.get("name", "")), known) for e in inside)
        lines = element.iterfind(f"{{{SSD}}}Connections/{{{SSD}}}Connection")
        read = tuple(_line(path, place, line) for line in lines)
        return SsdElement(place, connectors, bindings, parts=tuple(parts), lines=read)

    def _inner(self, file: File, entry: str, element: Element, place: Place) -> SsdElement:
        """The root system of the .ssp or .ssd that a component is (SSP 2.0, section 5.4)."""
        if len(place) > DEEPEST:
            raise InputFault(
                f"{file.path}: {join_place(place)}: more than {DEEPEST} files in files"
            )
        file.size.grow(file.path, files=1)
        if element.get("type") == PACKAGE:
            if entry not in file.archive.NameToInfo:
                raise InputFault(f"{file.path}: {join_place(place)}: there is no {entry!r} in it")
            path, packed = file.path / entry, file.archive.NameToInfo[entry].file_size
            file.size.grow(path, archives=packed)
            content = BytesIO(file.archive.read(entry))
            archive = self.archives.enter_context(open_archive(path, "SSP", content))
            file.size.grow(path, archives=sum(e.file_size for e in archive.infolist()))
            return self.root(File(path, archive, size=file.size), place)[1]
        return self.root(replace(file, entry=entry), place)[1]


def _dictionaries(file: File, system: Element, place: Place) -> dict[str, Dictionary]:
    """The signal dictionaries that a system defines."""
    found = {}
    for element in system.iterfind(f"{{{SSD}}}SignalDictionaries/{{{SSD}}}SignalDictionary"):
        name = element.get("name", "")
        read = content(file, element, join_place(place, name), SSB, "SignalDictionary")
        own = {**file.units, **units(file.path, read, SSB)}
        entries = {
            e.get("name", ""): _unit(e, own) for e in read.iterfind(f"{{{SSB}}}DictionaryEntry")
        }
        found[name] = Dictionary((*place, name), entries)
    return found


def _reference(
    file: File,
    element: Element,
    place: Place,
    connectors: Mapping[str, Connector],
    known: Mapping[str, Dictionary],
) -> SsdElement:
    """A reference to a dictionary. Raises InputFault where that or an entry does not exist."""
    name = element.get("dictionary", "")
    if name not in known:
        there = ", ".join(known) or "none"
        raise InputFault(
            f"{file.path}: {join_place(place)}: no signal dictionary {name!r}; {there}"
        )
    entries = known[name].units
    if missing := connectors.keys() - entries:
        there = ", ".join(entries) or "none"
        what = f"{join_place(place, min(missing))} is no entry of {name!r}"
        raise InputFault(f"{file.path}: {what}; entries: {there}")
    with_units = {n: replace(c, unit=c.unit or entries[n]) for n, c in connectors.items()}
    return SsdElement(place, with_units, (), dictionary=known[name].place)


def _source_of(path: Path, where: str, element: Element) -> str:
    """The source of a component. Raises InputFault for an element that is none to run."""
    kind, type_ = element.tag.removeprefix(f"{{{SSD}}}"), element.get("type", FMU)
    how, source = element.get("implementation", "any"), element.get("source")
    if kind == "Component":
        known = type_ in (FMU, PACKAGE, DEFINITION)
        if known and source and how in IMPLEMENTATIONS:
            return source
        unfit = f" for {how}" if how not in IMPLEMENTATIONS else " without source"
        kind += unfit if known else f" of type {type_}"
    raise InputFault(
        f"{path}: {where} is a {kind}; supported are systems, and components that are FMUs for "
        "co-simulation or model exchange, .ssp or .ssd: connect signals one by one"
    )


def _connector(file: File, place: Place, element: Element) -> Connector:
    kind, name = element.get("kind", ""), join_place(place, element.get("name", ""))
    if kind in ("inout", "unspecified"):
        raise InputFault(f"{file.path}: {name} is {kind}; give its kind as input or output")
    sizes = (d.get("size") for d in element.iterfind(f"{{{SSC}}}Dimension"))
    return Connector(
        kind, _unit(element, file.units), tuple(int(size) if size else None for size in sizes)
    )


def _unit(element: Element, known: Mapping[str, Unit]) -> Unit | None:
    """The unit of a connector or an entry, which its type has."""
    unit = next((e.get("unit") for e in element if e.get("unit")), None)
    return known.get(unit, Unit(unit)) if unit else None


def indices(sizes: Sequence[int | None]) -> list[str]:
    """The indices of all entries of an array, [] where a size is left open. Raises InputFault for
    more than MAX_NUMBERS entries."""
    if None in sizes:
        return []
    if math.prod(size or 0 for size in sizes) > variables.MAX_NUMBERS:
        raise InputFault(f"an array of the sizes {sizes}; at most {variables.MAX_NUMBERS} entries")
    return variables.indices(size or 0 for size in sizes)


def _line(path: Path, place: Place, element: Element) -> SsdConnection:
    def node(end: str) -> Node:
        inside, name = element.get(f"{end}Element"), element.get(f"{end}Connector", "")
        if entry := element.get(f"{end}Indices", "").split():  # from 1, by its authors' examples
            name += f"[{','.join(entry)}]"
        return (*place, inside) if inside else place, name

    ends = (node("start"), node("end"))
    names = " and ".join(join_place(*end) for end in ends)
    if table := table_of(element):
        what = f"{table[0]}MappingTransformation is read in parameter mappings only"
        raise InputFault(f"{path}: connection of {names}: {what}; put its table into an FMU")
    return SsdConnection(ends, linear_of(element), converts(element))


def linear_of(element: Element) -> Linear:
    """The linear transformation of a connection or mapping."""
    linear = element.find(f"{{{SSC}}}LinearTransformation")
    if linear is None:
        return SAME
    return Linear(float(linear.get("factor", "1")), float(linear.get("offset", "0")))


def table_of(element: Element) -> tuple[str, dict[str, str]] | None:
    """The mapping transformation of a connection or mapping: the type of its values, "Boolean",
    "Integer" or "Enumeration", and the target of each source."""
    for child in element:
        if child.tag.endswith(end := "MappingTransformation"):
            kind = child.tag.removeprefix(f"{{{SSC}}}").removesuffix(end)
            return kind, {e.get("source", ""): e.get("target", "") for e in child}
    return None


def converts(element: Element) -> bool:
    """Whether a connection or mapping converts units."""
    return element.get("suppressUnitConversion") not in ("true", "1")
