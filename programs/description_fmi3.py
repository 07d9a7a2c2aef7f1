"""The descriptions of a program of FMI 3.0.2: modelDescription.xml, terminals, and how it is built.

A vector or matrix is one variable, whose value reference is that of its first scalar. The
standard has one unit for a variable: where entries have different ones, its description lists
them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from xml.etree import ElementTree as ET

from hapticlink.fmus.model_description import as_text
from hapticlink.fmus.python_fmu import icon
from hapticlink.orchestrator.fmi.capabilities import ONCE, SERIALISED, STATE, VARIABLE_STEP
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.programs.description import (
    SECOND,
    about,
    definitions,
    documentation,
    of_model,
)
from hapticlink.programs.ports import Array, Port, arrays

CAPABILITIES = {
    ONCE: ONCE, STATE["3"]: STATE["2"], SERIALISED["3"]: SERIALISED["2"],
    VARIABLE_STEP: VARIABLE_STEP,
}  # fmt: skip
"""Those of FMI 3.0, with what FMI 2.0 calls them."""
TIME = "time"


def described(
    scene: Scene,
    identifier: str,
    ports: Sequence[Port],
    *,
    capable: Mapping[str, str],
    guid: str,
    step_size: float,
    files: Iterable[str],
    pictures: Mapping[str, bytes],
) -> dict[str, bytes]:
    """As `description.described`. guid: the instantiation token."""
    variables = [*arrays(ports)]
    text = _model_description(
        scene, identifier, ports, variables, capable=capable, token=guid, step_size=step_size
    )
    return {
        "modelDescription.xml": text,
        "terminalsAndIcons/terminalsAndIcons.xml": _terminals(variables),
        "terminalsAndIcons/icon.png": icon("continuous"),
        "sources/buildDescription.xml": _build_description(identifier, files),
        **documentation(scene, ports, pictures),
    }


def _model_description(
    scene: Scene,
    identifier: str,
    ports: Sequence[Port],
    arrays: Sequence[Array],
    *,
    capable: Mapping[str, str],
    token: str,
    step_size: float,
) -> bytes:
    attributes = of_model(scene, identifier)
    root = ET.Element("fmiModelDescription", attributes, fmiVersion="3.0", instantiationToken=token)
    runs = {"modelIdentifier": identifier, "needsExecutionTool": "false"}
    capabilities = {name: capable[of_fmi2] for name, of_fmi2 in CAPABILITIES.items()}
    ET.SubElement(root, "CoSimulation", runs | capabilities)
    definitions(root, scene, ports, step_size)
    variables = ET.SubElement(root, "ModelVariables")
    holder = {p.name: a for a in arrays for p in a.entries}
    for array in arrays:
        _variable(variables, array, holder)
    time = {"causality": "independent", "variability": "continuous", "unit": SECOND}
    last = sum(len(a.entries) for a in arrays)
    described = {"name": TIME, "valueReference": str(last), "description": "Simulation time."}
    ET.SubElement(variables, "Float64", described | time)
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [a for a in arrays if a.entries[0].kind == "OUTPUT"]
    for output in outputs:
        known = sorted({holder[name].reference for p in output.entries for name in p.depends})
        depends = {"dependencies": " ".join(map(str, known))}
        ET.SubElement(structure, "Output", {"valueReference": str(output.reference)} | depends)
    for output in outputs:
        ET.SubElement(structure, "InitialUnknown", valueReference=str(output.reference))
    return as_text(root)


def _variable(variables: ET.Element, array: Array, holder: dict[str, Array]) -> None:
    first = array.entries[0]
    units = [port.unit for port in array.entries]
    described = first.description
    if len(set(units)) > 1:
        described = f"{described.rstrip('.')} ({', '.join(units)})"
    attributes = {
        "name": array.name,
        "valueReference": str(array.reference),
        "description": described,
    }
    attributes |= about(first)
    if len(set(units)) == 1 and units[0]:
        attributes["unit"] = units[0]
    if first.start is not None:
        attributes["start"] = " ".join(repr(float(port.start or 0.0)) for port in array.entries)
    if first.max is not None:
        attributes["max"] = repr(float(first.max))
    base = holder.get(first.derivative_of or "")
    if base and base.shape == array.shape:
        attributes["derivative"] = str(base.reference)
    element = ET.SubElement(variables, "Float64", attributes)
    for size in array.shape:
        ET.SubElement(element, "Dimension", start=str(size))


def _terminals(arrays: Iterable[Array]) -> bytes:
    """terminalsAndIcons.xml: a terminal for each block, with its inputs and outputs, and the extent
    of the icon."""
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    picture = ET.SubElement(root, "GraphicalRepresentation")
    extent = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    ET.SubElement(picture, "CoordinateSystem", extent | {"suggestedScalingFactorTo_mm": "0.1"})
    ET.SubElement(picture, "Icon", extent)
    by_block: dict[str, ET.Element] = {}
    for array in arrays:
        if array.entries[0].kind not in ("INPUT", "OUTSIDE", "OUTPUT"):
            continue
        block, _, port = array.name.partition(".")
        if block not in by_block:
            if not by_block:
                parent = ET.SubElement(root, "Terminals")
            by_block[block] = ET.SubElement(parent, "Terminal", name=block, matchingRule="bus")
        member = {"variableName": array.name, "memberName": port, "variableKind": "signal"}
        ET.SubElement(by_block[block], "TerminalMemberVariable", member)
    return as_text(root)


def _build_description(identifier: str, files: Iterable[str]) -> bytes:
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    # A fused multiply-add rounds once, and would change the results.
    options = {"language": "C11", "compilerOptions": "-ffp-contract=off"}
    listed = ET.SubElement(configuration, "SourceFileSet", options)
    for name in files:
        ET.SubElement(listed, "SourceFile", name=name)
    return as_text(root)
