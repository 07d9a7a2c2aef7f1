"""modelDescription.xml of a program, FMI 2.0.5 co-simulation, and its page of documentation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import PurePosixPath
from xml.etree import ElementTree as ET

from hapticlink.components.base_units import BASES
from hapticlink.fmus.documentation import STYLE
from hapticlink.fmus.model_description import LOG_CATEGORIES, as_text, of_maker
from hapticlink.fmus.python_fmu import icon
from hapticlink.fmus.units import base_unit
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.programs.ports import Port

PAGE = "documentation/index.html"
SECOND = "s"
"""Of the variable `time` of FMI 3.0."""
CAUSALITY = {
    "INPUT": "input",
    "OUTSIDE": "input",
    "PARAMETER": "parameter",
    "OUTPUT": "output",
    "ENERGY": "local",
    "STEP_ERROR": "local",
}


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
    """The files that describe the program, the same for the same arguments. capable: its
    capabilities, as FMI 2.0 calls them. step_size (s): of the default experiment. files: the C
    files to compile, in sources/. pictures: PNGs of the page, by caption."""
    attributes = of_model(scene, identifier)
    root = ET.Element("fmiModelDescription", attributes, fmiVersion="2.0", guid=guid)
    runs = {"modelIdentifier": identifier, "needsExecutionTool": "false"}
    simulation = ET.SubElement(root, "CoSimulation", runs | {**capable})
    listed = ET.SubElement(simulation, "SourceFiles")
    for name in files:
        ET.SubElement(listed, "File", name=name)
    definitions(root, scene, ports, step_size)
    _variables(root, ports)
    _structure(root, ports)
    return {
        "modelDescription.xml": as_text(root),
        "model.png": icon("continuous"),
        **documentation(scene, ports, pictures),
    }


def of_model(scene: Scene, identifier: str) -> dict[str, str]:
    """The attributes of the program in modelDescription.xml. FMUs of others name their variables as
    they like."""
    naming = "flat" if any(fmu.path for fmu in scene.fmu) else "structured"
    return {
        "modelName": identifier,
        "description": scene.title,
        **of_maker(),
        "variableNamingConvention": naming,
    }


def definitions(root: ET.Element, scene: Scene, ports: Sequence[Port], step_size: float) -> None:
    """Units, categories of messages and the default experiment, as FMI 2.0 and 3.0 have them."""
    units = {SECOND: None} | {port.unit: port.defined for port in ports if port.unit}
    parent = ET.SubElement(root, "UnitDefinitions")
    for name, unit in sorted(units.items()):
        element = ET.SubElement(parent, "Unit", name=name)
        if unit is None:
            powers = {base: str(power) for base, power in base_unit(name).items()}
            ET.SubElement(element, "BaseUnit", powers)
        elif unit.base is not None:
            powers = {b: str(n) for b, n in zip(BASES, unit.base, strict=True) if n}
            shift = {"factor": repr(unit.factor), "offset": repr(unit.offset)}
            ET.SubElement(element, "BaseUnit", powers | shift)
    categories = ET.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=text)
    times = {"startTime": 0.0, "stopTime": float(scene.duration), "stepSize": step_size}
    ET.SubElement(root, "DefaultExperiment", {name: repr(t) for name, t in times.items()})


def about(port: Port) -> dict[str, str]:
    """Causality, variability and, where it has to be said, how a variable starts."""
    attributes = {"causality": CAUSALITY[port.kind], "variability": "continuous"}
    if port.kind == "PARAMETER":
        return attributes | {
            "variability": "fixed" if port.fixed else "tunable",
            "initial": "exact",
        }
    if port.start is None:
        kind = "discrete" if port.sampled else "continuous"
        return attributes | {"variability": kind, "initial": "calculated"}
    return attributes


def _variables(root: ET.Element, ports: Sequence[Port]) -> None:
    parent = ET.SubElement(root, "ModelVariables")
    index = {port.name: str(i + 1) for i, port in enumerate(ports)}
    for reference, port in enumerate(ports):
        name = {"name": port.name, "valueReference": str(reference)}
        attributes = name | {"description": port.description} | about(port)
        real = ET.SubElement(ET.SubElement(parent, "ScalarVariable", attributes), "Real")
        if port.unit:
            real.set("unit", port.unit)
        if port.start is not None:
            real.set("start", repr(float(port.start)))
        if port.max is not None:
            real.set("max", repr(float(port.max)))
        if port.derivative_of:
            real.set("derivative", index[port.derivative_of])


def _structure(root: ET.Element, ports: Sequence[Port]) -> None:
    """Outputs with the inputs that they depend on at a communication point; at t = 0 outputs may
    depend on all that is set."""
    structure = ET.SubElement(root, "ModelStructure")
    index = {port.name: str(i + 1) for i, port in enumerate(ports)}
    outputs = [port for port in ports if port.kind == "OUTPUT"]
    if not outputs:
        return
    parent = ET.SubElement(structure, "Outputs")
    for port in outputs:
        depends = " ".join(index[name] for name in port.depends)
        ET.SubElement(parent, "Unknown", index=index[port.name], dependencies=depends)
    parent = ET.SubElement(structure, "InitialUnknowns")
    for port in outputs:
        ET.SubElement(parent, "Unknown", index=index[port.name])


def documentation(
    scene: Scene, ports: Sequence[Port], pictures: Mapping[str, bytes]
) -> dict[str, bytes]:
    """An HTML page without references to elsewhere, and the files of its pictures."""
    images = {f"picture{i}.png": data for i, data in enumerate(pictures.values())}
    body = [
        f"<h1>{escape(scene.title)}</h1>",
        *(f"<p>{escape(part)}</p>" for part in scene.description.split("\n\n") if part.strip()),
        "<p>A scene of hapticlink as one FMU: its blocks, each at its own rate, with the holds "
        "between them. A communication step that ends between two ticks of the scene takes it to "
        "the last tick before.</p>",
        *(
            f'<figure><img src="{image}" alt="{escape(caption)}">'
            f"<figcaption>{escape(caption)}</figcaption></figure>"
            for image, caption in zip(images, pictures, strict=True)
        ),
    ]
    for title, kinds in (
        ("Inputs", ("INPUT", "OUTSIDE")),
        ("Parameters", ("PARAMETER",)),
        ("Outputs", ("OUTPUT",)),
        ("Measured", ("ENERGY", "STEP_ERROR")),
    ):
        if chosen := [port for port in ports if port.kind in kinds]:
            body += [f"<h2>{title}</h2>", *_table(chosen)]
    page = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f"<title>{escape(scene.title)}</title><style>{STYLE}</style></head><body>",
        *body,
        "</body></html>",
    ]
    files = {PAGE: "\n".join(page).encode() + b"\n"}
    return files | {f"{PurePosixPath(PAGE).parent}/{image}": images[image] for image in images}


def _table(ports: Iterable[Port]) -> list[str]:
    rows = []
    for port in ports:
        start = "" if port.start is None else repr(float(port.start))
        cells = (port.name, port.unit, start, port.description)
        rows.append("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>")
    head = "".join(f"<th>{name}</th>" for name in ("name", "unit", "start", "description"))
    return [f"<table><tr>{head}</tr>", *rows, "</table>"]
