"""The files that describe an FMU of FMI 3.0.2: modelDescription.xml, terminals and icon, and how it
is compiled.

A vector or matrix is one variable, whose value reference is that of its first scalar. The
standard has one unit for a variable: where entries have different ones, its description lists
them, and so does the annotation of a block.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from xml.etree import ElementTree as ET

from hapticlink.fmus.description_common import (
    Described,
    annotation,
    as_text,
    base_attributes,
    definitions,
    icon,
)
from hapticlink.fmus.scalar_variables import ArrayVariable, arrays

NOT_IN_FMI3 = ("canInterpolateInputs", "canNotUseMemoryManagementFunctions")
TIME, SECOND = "time", "s"
OWN_TIME = "simulation_time"
"""What the independent variable is called where the FMU has another one of the name `time`."""


def files(about: Described, token: str, sources: Iterable[str]) -> dict[str, bytes]:
    """As `model_description.files`. token: the instantiation token."""
    variables = [*arrays(about.variables)]
    return {
        "modelDescription.xml": _model_description(about, variables, token),
        "terminalsAndIcons/terminalsAndIcons.xml": _terminals(() if about.component else variables),
        "terminalsAndIcons/icon.png": icon(about),
        "sources/buildDescription.xml": _build_description(about.name, sources),
    }


def _model_description(about: Described, arrays: Sequence[ArrayVariable], token: str) -> bytes:
    root = ET.Element(
        "fmiModelDescription", about.attributes, fmiVersion="3.0", instantiationToken=token
    )
    capable = {
        name.replace("FMUstate", "FMUState"): value
        for name, value in about.capabilities.items()
        if name not in NOT_IN_FMI3
    }
    ET.SubElement(root, "CoSimulation", about.implementation | capable)
    definitions(root, replace(about, units={SECOND: base_attributes(SECOND), **about.units}))
    variables = ET.SubElement(root, "ModelVariables")
    holder = {v.name: a for a in arrays for v in a.entries}
    for array in arrays:
        _variable(variables, array, holder)
    time = {"causality": "independent", "variability": "continuous", "unit": SECOND}
    last = {"valueReference": str(len(about.variables)), "description": "Simulation time."}
    name = OWN_TIME if TIME in holder else TIME
    ET.SubElement(variables, "Float64", {"name": name} | last | time)
    _model_structure(root, about, arrays, holder)
    if about.component:
        annotations = ET.SubElement(root, "Annotations")
        block = annotation(about.component)
        for array in arrays:
            if len(units := _units(array)) > 1:
                ET.SubElement(block, "Port", name=array.name, units=" ".join(units))
        ET.SubElement(annotations, "Annotation", type="hapticlink").append(block)
    return as_text(root)


def _units(array: ArrayVariable) -> list[str]:
    """The unit of all entries, or those of each."""
    units = [v.unit for v in array.entries]
    return units if len(set(units)) > 1 else units[:1]


def _variable(
    variables: ET.Element, array: ArrayVariable, holder: Mapping[str, ArrayVariable]
) -> None:
    first, units = array.entries[0], _units(array)
    name = {"name": array.name, "valueReference": str(array.reference)}
    attributes = name | first.attributes
    if len(units) > 1:
        listed = f"({', '.join(units)})"
        attributes["description"] = f"{first.description.rstrip('.')} {listed}".lstrip()
    elif units[0]:
        attributes["unit"] = units[0]
    if first.start is not None:
        attributes["start"] = " ".join(repr(float(v.start or 0.0)) for v in array.entries)
    if first.max is not None:
        attributes["max"] = repr(float(first.max))
    base = holder.get(first.derivative_of or "")
    if base and base.shape == array.shape:
        attributes["derivative"] = str(base.reference)
    element = ET.SubElement(variables, "Float64", attributes)
    for size in array.shape:
        ET.SubElement(element, "Dimension", start=str(size))


def _model_structure(
    root: ET.Element,
    about: Described,
    arrays: Sequence[ArrayVariable],
    holder: Mapping[str, ArrayVariable],
) -> None:
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [a for a in arrays if a.entries[0].kind == "OUTPUT"]
    through = {v.name: v.depends for output in outputs for v in output.entries}
    for tag, depends in (("Output", through), ("InitialUnknown", about.initial)):
        for output in outputs:
            element = ET.SubElement(structure, tag, valueReference=str(output.reference))
            if depends is not None:
                names = (name for v in output.entries for name in depends[v.name])
                known = sorted({holder[name].reference for name in names})
                element.set("dependencies", " ".join(map(str, known)))


def _terminals(arrays: Iterable[ArrayVariable]) -> bytes:
    """terminalsAndIcons.xml: of a scene a terminal for each block, with its inputs and outputs, and
    the extent of the icon."""
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    picture = ET.SubElement(root, "GraphicalRepresentation")
    extent = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    ET.SubElement(picture, "CoordinateSystem", extent | {"suggestedScalingFactorTo_mm": "0.1"})
    ET.SubElement(picture, "Icon", extent)
    by_block: dict[str, ET.Element] = {}
    for array in arrays:
        block, _, port = array.name.partition(".")
        if array.entries[0].causality not in ("input", "output"):
            continue
        if block not in by_block:
            if not by_block:
                parent = ET.SubElement(root, "Terminals")
            by_block[block] = ET.SubElement(parent, "Terminal", name=block, matchingRule="bus")
        member = {"variableName": array.name, "memberName": port, "variableKind": "signal"}
        ET.SubElement(by_block[block], "TerminalMemberVariable", member)
    return as_text(root)


def _build_description(identifier: str, sources: Iterable[str]) -> bytes:
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    # A fused multiply-add rounds once, and would change the results. gcc has this option, too.
    options = {"language": "C11", "compiler": "clang", "compilerOptions": "-ffp-contract=off"}
    listed = ET.SubElement(configuration, "SourceFileSet", options)
    for name in sources:
        ET.SubElement(listed, "SourceFile", name=name)
    return as_text(root)
