"""Reads an OspSystemStructure.xml of the Open Simulation Platform as the tables of a scene.

Its fixed-step algorithm gets all outputs, sets all inputs and steps all simulators: `jacobi`, with
values held until the next sample, and without conversion of units. A simulator's step is a whole
number of base steps, stepSize/BaseStepSize rounded, at least one (`fixed_step_algorithm.cpp` of
libcosim 0.11.2, data/xsd/OspSystemStructure.xsd).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse
from xml.etree.ElementTree import Element, fromstring

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.fmi.archive import MAX_XML_BYTES, require_plain_xml
from hapticlink.orchestrator.fmi.description import Description, describe

SUFFIX = ".xml"
_NAMESPACE = "{http://opensimulationplatform.com/MSMI/OSPSystemStructure}"
_VALUES: dict[str, Callable[[str], Any]] = {
    "Real": float,
    "Integer": int,
    "Boolean": {"true": True, "1": True, "false": False, "0": False}.__getitem__,
    "String": str,
}


def tables(path: Path) -> dict[str, Any]:
    """The tables of its scene. Raises InputFault, with file and element, for what is malformed or
    not supported."""
    text = text_files.read_text(path, "a system structure", MAX_XML_BYTES).encode()
    require_plain_xml(text, str(path))
    root = fromstring(text)
    if root.tag != f"{_NAMESPACE}OspSystemStructure":
        raise InputFault(f"{path}: its root is {root.tag}, not an OspSystemStructure")
    return _System(path, root).tables


class _System:
    def __init__(self, path: Path, root: Element) -> None:
        self._path = path
        simulators = [*_all(root, "Simulators/Simulator")]
        self._described = {s.get("name", ""): describe(self._file(s)) for s in simulators}
        start, end, base = (
            self._number(root, key) for key in ("StartTime", "EndTime", "BaseStepSize")
        )
        if (algorithm := root.findtext(f"{_NAMESPACE}Algorithm", "fixedStep")) != "fixedStep":
            self._warn(f"Algorithm = {algorithm}: steps are fixed here, of BaseStepSize")
        self.tables: dict[str, Any] = {"title": path.stem, "coupling": "jacobi"}
        if start and exact(start):
            self.tables["start_time"] = float(exact(start))
        if end:
            self.tables["duration"] = float(exact(end) - exact(start or 0))
        if base:
            if not exact(base):
                raise self._refuse(f"BaseStepSize = {base}: write a number above 0")
            self.tables["haptics"] = {"rate": str(1 / exact(base))}
        self.tables["fmu"] = [self._fmu(s, base) for s in simulators]
        self._functions = {f.get("name", ""): f for f in root.iterfind(f"{_NAMESPACE}Functions/*")}
        self.tables["connection"] = [*self._connections(root)]

    def _warn(self, message: str) -> None:
        logging.getLogger(__name__).warning("%s: %s", self._path, message)

    def _refuse(self, what: str) -> InputFault:
        return InputFault(f"{self._path}: {what}")

    def _number(self, element: Element, key: str) -> str | None:
        text = element.findtext(_NAMESPACE + key) or element.get(key)
        try:
            if text is None or exact(text.strip()) >= 0:
                return text and text.strip()
        except (ValueError, ZeroDivisionError):
            pass
        raise self._refuse(f"{key} = {text}: write a number that is not negative")

    def _file(self, simulator: Element) -> Path:
        source = urlparse(simulator.get("source", ""))
        if source.scheme not in ("", "file"):
            raise self._refuse(
                f"simulator {simulator.get('name')}: {source.geturl()} is on another computer or "
                "in a process of its own: give the FMU's file, and isolate = true"
            )
        return self._path.parent / unquote(source.path)

    def _fmu(self, simulator: Element, base: str | None) -> dict[str, Any]:
        name = simulator.get("name", "")
        found: dict[str, Any] = {"name": name, "path": str(self._described[name].path)}
        if (step := self._number(simulator, "stepSize")) and base:
            found["rate"] = str(1 / (max(round(exact(step) / exact(base)), 1) * exact(base)))
        found["start"] = {
            value.get("variable", ""): self._value(f"{name}.{value.get('variable')}", given)
            for value in _all(simulator, "InitialValues/InitialValue")
            for given in value
        }
        return found

    def _value(self, of: str, given: Element) -> bool | float | str:
        kind, text = given.tag.removeprefix(_NAMESPACE), given.get("value", "")
        if kind not in _VALUES:
            raise self._refuse(f"{of}: {kind} is none of {', '.join(_VALUES)}")
        try:
            return _VALUES[kind](text)
        except (ValueError, KeyError):
            raise self._refuse(f"{of} = {text}: no {kind}") from None

    def _connections(self, root: Element) -> Iterator[dict[str, Any]]:
        into: dict[str, str] = {}
        out_of: list[tuple[str, str]] = []
        for connection in root.iterfind(f"{_NAMESPACE}Connections/*"):
            kind = connection.tag.removeprefix(_NAMESPACE)
            if kind not in ("VariableConnection", "SignalConnection"):
                raise self._refuse(f"{kind}: write a VariableConnection for each of its variables")
            ends = [*connection]
            if len(ends) != 2:
                raise self._refuse(f"{kind}: it has {len(ends)} ends, not 2")
            if kind == "VariableConnection":
                yield self._wire(*self._sorted(ends))
            elif ends[0].tag == f"{_NAMESPACE}Signal":
                out_of.append((self._function(ends[0]), _variable(ends[1])))
            else:
                into[self._function(ends[1])] = _variable(ends[0])
        for function, target in out_of:
            if function not in into:
                raise self._refuse(f"function {function}: nothing is connected to its input")
            yield self._wire(into[function], target) | {
                key: self._term(function, key, default)
                for key, default in (("factor", "1"), ("offset", "0"))
            }

    def _term(self, function: str, key: str, default: str) -> float:
        text = self._functions[function].get(key, default)
        try:
            return float(text)
        except ValueError:
            raise self._refuse(f"function {function}: {key} = {text}: write a number") from None

    def _wire(self, source: str, target: str) -> dict[str, Any]:
        return {"from": source, "to": target, "convert": False}

    def _function(self, signal: Element) -> str:
        name = signal.get("function", "")
        if name not in self._functions:
            raise self._refuse(f"there is no function {name!r}")
        if (kind := self._functions[name].tag.removeprefix(_NAMESPACE)) != "LinearTransformation":
            raise self._refuse(
                f"function {name}: {kind} has no counterpart: put it into an FMU, e.g. by "
                "pythonfmu, or into a block (docs/extending.md)"
            )
        return name

    def _sorted(self, ends: list[Element]) -> tuple[str, str]:
        """The output and the input of a connection, which may be written in either order."""
        outputs = [end for end in ends if self._is_output(end)]
        if len(ends) != 2 or len(outputs) != 1:
            names = " and ".join(map(_variable, ends))
            raise self._refuse(f"connection of {names}: one of the two has to be an output")
        (target,) = (end for end in ends if end is not outputs[0])
        return _variable(outputs[0]), _variable(target)

    def _is_output(self, end: Element) -> bool:
        simulator, name = end.get("simulator", ""), end.get("name")
        if simulator not in self._described:
            raise self._refuse(f"there is no simulator {simulator!r}")
        about: Description = self._described[simulator]
        return any(s.name == name and s.causality == "output" for s in about.scalars)


def _all(element: Element, path: str) -> Iterator[Element]:
    return element.iterfind("/".join(_NAMESPACE + part for part in path.split("/")))


def _variable(end: Element) -> str:
    return f"{end.get('simulator')}.{end.get('name')}"
