"""Writes a scene as an SSP, SystemStructure.ssd and the FMUs, for this and other tools.

Its version is 1.0, or 2.0 with an FMU of FMI 3.0, whose types, arrays and clocks 1.0 does not have.
Each connection is from scalar to scalar. Rates, holds and connections to parameters, which no SSP
has, are in an annotation, as JSON with the keys of a scene.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from hapticlink.components.ports import BASES
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.reproducible_zip import write_zip
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.type_adapters import adapter
from hapticlink.orchestrator.fmi.description import INTERFACES
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.rates import AnyRate
from hapticlink.orchestrator.scene.scene import Graphics, Scene
from hapticlink.orchestrator.scene.scene_tables import Wire
from hapticlink.orchestrator.ssp import step_sizes
from hapticlink.orchestrator.ssp.names import (
    ANNOTATION,
    FMU,
    NOT_IN_ANNOTATION,
    OF_GRAPHICS,
    RUN,
    SSC,
    SSD,
    SSV,
    STRUCTURE,
)
from hapticlink.orchestrator.system.system import Connection, Fmu, System

PREFIXES = {
    "ssd": SSD,
    "ssc": SSC,
    "ssv": SSV,
    "osp": step_sizes.OSP,
    "oms": step_sizes.OMS,
    "hapticlink": RUN,
}
"""libcosim and Ecos know elements by prefixes, these ones, not by namespaces."""


def write_ssp(scene: Scene, system: System, target: Path) -> Path:
    """Write the SSP `target` atomically; the same scene gives the same bytes. Raises InputFault if
    it is a folder, or its own cannot be written to."""
    folders.ensure(target.parent)
    if target.is_dir():
        raise InputFault(f"{target}: is a folder; name a file in it, {target / 'scene.ssp'}")
    name = re.sub(r"\W|^(?=\d)", "_", target.stem)
    fmus = {f"resources/{u.name}.fmu": u.description.path.read_bytes() for u in system.fmus}
    with atomic_file(target) as unfinished, unfinished.open("xb") as file:
        write_zip({STRUCTURE: structure(scene, system, name), **fmus}, file)
    return target


def structure(scene: Scene, system: System, name: str) -> bytes:
    """The text of SystemStructure.ssd, of a system of this name."""
    for prefix, space in PREFIXES.items():
        register_namespace(prefix, space)
    version = "2.0" if any(unit.description.fmi == "3" for unit in system.fmus) else "1.0"
    about = {"version": version, "name": name, "description": scene.title}
    root = Element(f"{{{SSD}}}SystemStructureDescription", about)
    top = SubElement(root, f"{{{SSD}}}System", name="system")
    elements = SubElement(top, f"{{{SSD}}}Elements")
    for unit in system.fmus:
        step_sizes.of_component(_component(elements, unit, version), system, unit)
    wires = {w.name: w for w in scene.connection}
    lines = [c for c in system.connections if not c.to_parameter]
    variable = {
        (unit.name, s.name): (name, s.indices if len(entries) > 1 else ())
        for unit in system.fmus
        for name, entries in _variables(unit).items()
        for s in entries
    }
    if lines:
        connections = SubElement(top, f"{{{SSD}}}Connections")
    for c in lines:
        for a, b in zip(c.outputs, c.inputs, strict=True):
            ends = {}
            for end, fmu, scalar in (("start", c.source, a), ("end", c.target, b)):
                ends[f"{end}Element"] = fmu
                ends[f"{end}Connector"], indices = variable[fmu, scalar.name]
                if indices:
                    ends[f"{end}Indices"] = " ".join(map(str, indices))
            wire = wires.get(c.name)
            if wire and not wire.convert:
                ends["suppressUnitConversion"] = "true"
            line = SubElement(connections, f"{{{SSD}}}Connection", ends)
            if wire and (wire.factor, wire.offset) != (1.0, 0.0):
                linear = {"factor": repr(wire.factor), "offset": repr(wire.offset)}
                SubElement(line, f"{{{SSC}}}LinearTransformation", linear)
    step_sizes.of_system(top, system)
    _units(root, system)
    times = {"startTime": repr(scene.start_time), "stopTime": repr(scene.stop_time)}
    experiment = SubElement(root, f"{{{SSD}}}DefaultExperiment", times)
    step_sizes.of_experiment(experiment, system)
    annotations = SubElement(root, f"{{{SSD}}}Annotations")
    annotation = SubElement(annotations, f"{{{SSC}}}Annotation", type=ANNOTATION)
    SubElement(annotation, f"{{{RUN}}}Scene").text = json.dumps(_rest(scene, system), indent=1)
    indent(root)
    return tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _component(elements: Element, unit: Fmu, version: str) -> Element:
    about = {"name": unit.name, "type": FMU, "source": f"resources/{unit.name}.fmu"}
    kind = INTERFACES["model-exchange" if unit.description.equations else "co-simulation"]
    component = SubElement(elements, f"{{{SSD}}}Component", about, implementation=kind)
    variables = _variables(unit)
    taken = ("input", "output", "parameter")
    shown = {n: e for n, e in variables.items() if e[0].causality in taken}
    if shown:
        connectors = SubElement(component, f"{{{SSD}}}Connectors")
    for name, (s, *_) in shown.items():
        about = {"name": name, "kind": s.causality}
        connector = SubElement(connectors, f"{{{SSD}}}Connector", about)
        unit_of = {"unit": s.unit} if s.unit and unit.description.units.get(s.unit) else {}
        SubElement(connector, f"{{{SSC}}}{s.type}", unit_of)
        _dimensions(connector, shown[name])
    if unit.starts:
        bindings = SubElement(component, f"{{{SSD}}}ParameterBindings")
        binding = SubElement(bindings, f"{{{SSD}}}ParameterBinding")
        values = SubElement(binding, f"{{{SSD}}}ParameterValues")
        set_ = SubElement(values, f"{{{SSV}}}ParameterSet", version=version, name="start")
        parameters = SubElement(set_, f"{{{SSV}}}Parameters")
    given = unit.start_values
    started = {n: e for n, e in variables.items() if any(s.name in given for s in e)}
    for name, entries in started.items():
        text = " ".join(_text(s, given.get(s.name, s.start)) for s in entries)
        parameter = SubElement(parameters, f"{{{SSV}}}Parameter", name=name)
        SubElement(parameter, f"{{{SSV}}}{entries[0].type}", value=text)
        _dimensions(parameter, entries)
    return component


def _variables(unit: Fmu) -> dict[str, list[Scalar]]:
    """The scalars of each variable by its name: of an array of FMI 3.0 all entries, row by row,
    which share a reference."""
    description = unit.description
    references = Counter(s.reference for s in description.scalars)
    variables: dict[str, list[Scalar]] = {}
    for s in (*description.scalars, *description.strings):
        array = description.fmi == "3" and references[s.reference] > 1
        variables.setdefault(s.port if array else s.name, []).append(s)
    return variables


def _dimensions(element: Element, entries: list[Scalar]) -> None:
    for size in entries[-1].indices if len(entries) > 1 else ():
        SubElement(element, f"{{{SSC}}}Dimension", size=str(size))


def _text(scalar: Scalar, value: bool | int | float | str) -> str:
    if isinstance(value, str):
        return value
    if scalar.type == "Boolean":
        return str(bool(value)).lower()
    real = scalar.type.startswith(("Real", "Float"))
    return repr(float(value)) if real else str(int(value))


def _units(root: Element, system: System) -> None:
    """The units of the connectors, by name. Where FMUs define one name differently, one definition
    is written; each FMU uses its own."""
    named = {u.name: u for unit in system.fmus for u in unit.description.units.values()}
    if not named:
        return
    units = SubElement(root, f"{{{SSD}}}Units")
    for name in sorted(named):
        one = SubElement(units, f"{{{SSC}}}Unit", name=name)
        unit = named[name]
        powers = zip(BASES, unit.base or (0,) * len(BASES), strict=True)
        base = {b: str(n) for b, n in powers if n}
        base |= {"factor": repr(unit.factor)} if unit.factor != 1 else {}
        base |= {"offset": repr(unit.offset)} if unit.offset else {}
        SubElement(one, f"{{{SSC}}}BaseUnit", base)


def _rest(scene: Scene, system: System) -> dict[str, Any]:
    """The content of the annotation, with the keys of a scene."""
    keys = {f.name for f in fields(Scene)} - NOT_IN_ANNOTATION
    tables = adapter(Scene).dump_python(
        scene, mode="json", by_alias=True, exclude_none=True, include=keys
    )
    tables["stop_when"] = scene.ends_when if system.ends_when else ""
    tables["holds"] = scene.named_holds
    rates = blocks(scene).rates
    if scene.graphics and "graphics" in rates.values():
        tables["graphics"] = adapter(Graphics).dump_python(
            scene.graphics, mode="json", exclude_none=True, include={*OF_GRAPHICS}
        )
    as_json = partial(adapter(AnyRate).dump_python, mode="json")
    derivatives = {f.name: dict(f.derivatives) for f in scene.fmu if f.derivatives}
    tolerances = {f.name: f.tolerance for f in scene.fmu if f.tolerance is not None}
    tables["fmu"] = {
        u.name: {"rate": as_json(rates[u.name]), "timing": u.description.timing}
        | ({"tolerance": tolerances[u.name]} if u.name in tolerances else {})
        | {key: True for key in ("isolate", "hardware") if getattr(u, key)}
        | ({"derivatives": derivatives[u.name]} if u.name in derivatives else {})
        for u in system.fmus
    }
    wires = {w.name: w for w in scene.connection}
    tables["connection"] = [
        _row(c, wires.get(c.name)) for c in system.connections if c.to_parameter
    ]
    return tables


def _row(c: Connection, wire: Wire | None) -> dict[str, Any]:
    """A connection as a row of [[connection]]; its own hold is in [holds]."""
    row = {"from": c.from_, "to": c.to}
    if not wire:
        return row
    return row | {"factor": wire.factor, "offset": wire.offset, "convert": wire.convert}
