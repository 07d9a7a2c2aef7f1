"""The files that describe an FMU: its icon, its licenses, and modelDescription.xml of FMI 2.0.5
co-simulation; those of FMI 3.0.2 are in `model_description_fmi3`.

Value references count scalars from 0; the index in ModelStructure is the value reference + 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from xml.etree import ElementTree as ET

from hapticlink.fmus import licenses, model_description_fmi3
from hapticlink.fmus.description_common import Described, annotation, as_text, definitions, icon
from hapticlink.fmus.scalar_variables import ScalarVariable


def files(
    about: Described, guid: str, fmi: int = 2, sources: Iterable[str] = ()
) -> dict[str, bytes]:
    """The files that describe an FMU, without a date, so that the same arguments give the same
    bytes. guid: of FMI 3.0 the instantiation token. sources: the C files in sources/ to compile."""
    common = {licenses.ENTRY: licenses.licenses(about.needs_tool)}
    if fmi == 3:
        return common | model_description_fmi3.files(about, guid, sources)
    return common | {"modelDescription.xml": _text(about, guid, sources), "model.png": icon(about)}


def _text(about: Described, guid: str, sources: Iterable[str]) -> bytes:
    root = ET.Element("fmiModelDescription", about.attributes, fmiVersion="2.0", guid=guid)
    capable = about.implementation | dict(about.capabilities)
    simulation = ET.SubElement(root, "CoSimulation", capable)
    for i, name in enumerate(sources):  # section 4.3.1
        listed = simulation[0] if i else ET.SubElement(simulation, "SourceFiles")
        ET.SubElement(listed, "File", name=name)
    definitions(root, about)
    if about.component:
        tool = ET.SubElement(ET.SubElement(root, "VendorAnnotations"), "Tool", name="hapticlink")
        tool.append(annotation(about.component))
    _model_variables(root, about.variables)
    _model_structure(root, about)
    return as_text(root)


def _model_variables(root: ET.Element, variables: Sequence[ScalarVariable]) -> None:
    parent = ET.SubElement(root, "ModelVariables")
    index = {v.name: str(i + 1) for i, v in enumerate(variables)}
    for reference, v in enumerate(variables):
        name = {"name": v.name, "valueReference": str(reference)}
        scalar = ET.SubElement(parent, "ScalarVariable", name | v.attributes)
        real = ET.SubElement(scalar, "Real")
        if v.unit:
            real.set("unit", v.unit)
        if v.start is not None:
            real.set("start", repr(float(v.start)))
        if v.max is not None:
            real.set("max", repr(float(v.max)))
        if v.derivative_of:
            real.set("derivative", index[v.derivative_of])


def _model_structure(root: ET.Element, about: Described) -> None:
    """Outputs with the inputs that they depend on at a communication point, and at the start."""
    structure = ET.SubElement(root, "ModelStructure")
    index = {v.name: str(i + 1) for i, v in enumerate(about.variables)}
    outputs = [v for v in about.variables if v.kind == "OUTPUT"]
    if not outputs:
        return
    parent = ET.SubElement(structure, "Outputs")
    for v in outputs:
        depends = " ".join(index[name] for name in v.depends)
        ET.SubElement(parent, "Unknown", index=index[v.name], dependencies=depends)
    parent = ET.SubElement(structure, "InitialUnknowns")
    for v in outputs:
        unknown = ET.SubElement(parent, "Unknown", index=index[v.name])
        if about.initial is not None:
            unknown.set("dependencies", " ".join(index[name] for name in about.initial[v.name]))
