"""An SSP as the tables of a scene: ours to the bit, anyone's with a rate.

Components become [[fmu]], connections [[connection]] (entries that make up whole vectors in one),
parameter values `start`. Connections to the outside of the system have no counterpart in a scene
and are left out. What cannot be read is refused, never ignored.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import re
import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree.ElementTree import Element, fromstring

from fmpy.ssp.ssd import validate_tree
from lxml import etree

from hapticlink.fmus import cache
from hapticlink.orchestrator.archives import opened, read_xml
from hapticlink.orchestrator.description import Description, describe
from hapticlink.orchestrator.faults import InputFault
from hapticlink.orchestrator.ssp import ANNOTATION, FMU, RUN, SSC, SSD, SSV, STRUCTURE
from hapticlink.orchestrator.ticks import exact

_ENTRY = re.compile(r"\[[\d, ]+\]$")


def tables(path: Path) -> dict[str, Any]:
    """The tables of a scene. Raises InputFault, naming file and element, for what is malformed or
    not supported; the FMUs land in the cache."""
    with opened(path, "SSP") as archive:
        text = read_xml(archive, STRUCTURE)
        try:
            validate_tree(etree.fromstring(text), "SystemStructureDescription.xsd")
        except Exception as error:  # FMPy raises bare Exception
            raise InputFault(f"{path}: {STRUCTURE} is no SSP 1.0: {error}") from error
        root = fromstring(text)
        system = root.find(f"{{{SSD}}}System")
        assert system is not None  # the schema says so
        fmus = {
            c.get("name", ""): _fmu(path, archive, c)
            for c in system.iterfind(f"{{{SSD}}}Elements/*")
        }
        described = {name: describe(Path(fmu["path"])) for name, fmu in fmus.items()}
        for name, values in _bindings(path, archive, system):
            element, _, variable = name.partition(".")
            if element not in fmus:
                raise InputFault(f"{path}: parameter {name!r} is of no component")
            fmus[element]["start"][variable] = values
        rows = [_row(path, c, described) for c in system.iterfind(f"{{{SSD}}}Connections/*")]
    rest = _annotation(path, root)
    found: dict[str, Any] = {"title": root.get("name") or path.stem, **rest}
    names = {name: _identifier(name) for name in fmus}
    about = rest.get("fmu", {})
    found["fmu"] = [
        {**fmu, "name": names[name], **about.get(name, {})} for name, fmu in fmus.items()
    ]
    whole = _grouped([row for row in rows if row], described)
    found["connection"] = [
        {"from": f"{names[a]}.{p}", "to": f"{names[b]}.{q}", **how} for (a, p), (b, q), how in whole
    ] + rest.get("connection", [])
    _experiment(found, root, described)
    return found


def _experiment(found: dict[str, Any], root: Element, described: dict[str, Description]) -> None:
    """Duration and rate where there is no annotation: those of the default experiments, the rate
    of the FMU with the shortest step. Where they don't say, `scene_file` asks for them."""
    experiment = root.find(f"{{{SSD}}}DefaultExperiment")
    if "duration" not in found and experiment is not None and experiment.get("stopTime"):
        found["duration"] = float(experiment.get("stopTime", ""))
    steps = [exact(d.step_size) for d in described.values() if d.step_size]
    if "haptics" not in found and steps:
        found["haptics"] = {"rate": str(1 / min(steps))}


def _fmu(path: Path, archive: zipfile.ZipFile, element: Element) -> dict[str, Any]:
    name, kind = element.get("name"), element.tag.removeprefix(f"{{{SSD}}}")
    if kind != "Component" or element.get("type", FMU) != FMU:
        raise InputFault(
            f"{path}: {name} is a {kind} of type {element.get('type', 'none')}; only components "
            "that are FMUs are read: put the FMUs of inner systems into one system"
        )
    entry = unquote(element.get("source", "")).removeprefix("./")
    if entry not in archive.NameToInfo:
        held = ", ".join(n for n in archive.namelist() if n.endswith(".fmu")) or "none"
        raise InputFault(f"{path}: {name}: there is no {entry!r} in it; FMUs in it: {held}")
    content = archive.read(entry)
    file = _identifier(name or "") + ".fmu"

    def unpack(room: Path) -> Path:
        (room / file).write_bytes(content)
        return room / file

    kept = cache.cached({"ssp": hashlib.sha256(content).hexdigest(), "file": file}, unpack)
    if cache.folder() is None:
        atexit.register(shutil.rmtree, kept.parent, ignore_errors=True)
    own = _bindings(path, archive, element)
    return {"path": str(kept), "start": dict(own)}


def _identifier(name: str) -> str:
    return re.sub(r"\W", "_", name)


def _bindings(
    path: Path, archive: zipfile.ZipFile, element: Element
) -> Iterator[tuple[str, bool | int | float | str]]:
    """The parameter values bound to an element, by name."""
    for binding in element.iterfind(f"{{{SSD}}}ParameterBindings/{{{SSD}}}ParameterBinding"):
        if binding.find(f"{{{SSD}}}ParameterMapping") is not None:
            raise InputFault(f"{path}: {element.get('name')}: parameter mappings are not read")
        source = binding.get("source")
        sets = [*binding.iterfind(f"{{{SSD}}}ParameterValues/{{{SSV}}}ParameterSet")]
        if source:
            sets.append(fromstring(read_xml(archive, unquote(source))))
        for parameter in (p for s in sets for p in s.iterfind(f"{{{SSV}}}Parameters/*")):
            name = f"{binding.get('prefix', '')}{parameter.get('name')}"
            for value in parameter:
                kind = value.tag.removeprefix(f"{{{SSV}}}")
                read = _READ.get(kind)
                if read is None or value.get("unit"):
                    what = f"unit {value.get('unit')}" if read else f"type {kind}"
                    raise InputFault(f"{path}: parameter {name}: {what} is not read")
                yield name, read(value.get("value", ""))


_READ: dict[str, Any] = {
    "Real": float,
    "Integer": int,
    "Boolean": lambda text: text in ("true", "1"),
    "String": str,
}

End = tuple[str, str]
Row = tuple[End, End, dict[str, Any]]


def _row(path: Path, c: Element, described: dict[str, Description]) -> Row | None:
    """A connection from output to input, whichever way it was written."""
    start = (c.get("startElement"), c.get("startConnector", ""))
    end = (c.get("endElement"), c.get("endConnector", ""))
    if not start[0] or not end[0]:
        return None  # to the outside of the system
    for element, connector in (start, end):
        known = [s.name for s in described[element].scalars] if element in described else []
        if connector not in known:
            raise InputFault(
                f"{path}: a connection names {element}.{connector}, which is not there"
            )
    how: dict[str, Any] = {}
    for child in c:
        if child.tag == f"{{{SSC}}}LinearTransformation":
            how["factor"] = float(child.get("factor", "1"))
            how["offset"] = float(child.get("offset", "0"))
        elif child.tag.startswith(f"{{{SSC}}}"):
            raise InputFault(f"{path}: {start[0]}.{start[1]}: mappings of values are not read")
    if c.get("suppressUnitConversion") in ("true", "1"):
        how["convert"] = False
    ends = ((start[0], start[1]), (end[0], end[1]))
    if described[start[0]].port(start[1], "input"):
        return (*reversed(ends), how)  # type: ignore[return-value]
    return (*ends, how)


def _grouped(rows: list[Row], described: dict[str, Description]) -> Iterator[Row]:
    """Rows that join two vectors entry by entry, in order, as one."""
    i = 0
    while i < len(rows):
        (a, p), (b, q), how = rows[i]
        whole = (_ENTRY.sub("", p), _ENTRY.sub("", q))
        outputs = described[a].port(whole[0], "output")
        inputs = described[b].port(whole[1], "input")
        pairs = zip(outputs, inputs, strict=False)
        wanted = [((a, s.name), (b, t.name), how) for s, t in pairs]
        n = len(wanted)
        if n > 1 and len(outputs) == len(inputs) and rows[i : i + n] == wanted:
            yield (a, whole[0]), (b, whole[1]), how
            i += n
        else:
            yield rows[i]
            i += 1


def _annotation(path: Path, root: Element) -> dict[str, Any]:
    for annotation in root.iterfind(f"{{{SSD}}}Annotations/{{{SSC}}}Annotation"):
        if annotation.get("type") == ANNOTATION:
            try:
                found = json.loads(annotation.findtext(f"{{{RUN}}}Scene") or "")
            except json.JSONDecodeError as error:
                raise InputFault(f"{path}: annotation {ANNOTATION}: {error}") from error
            if not isinstance(found, dict):
                raise InputFault(f"{path}: annotation {ANNOTATION} holds no table")
            return found
    return {}
