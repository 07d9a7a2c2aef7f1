"""modelDescription.xml of a component, FMI 2.0.5 co-simulation.

Value references count [inputs | parameters | outputs] from 0 in flat order; the index in
ModelStructure is the value reference + 1.

Dependencies are structural, from CasADi's sparsity. `Outputs` lists the inputs on which an output
depends at a communication point (section 2.2.8). For a continuous block these are the inputs that
y = output(x, u, p, t) depends on. A sampled block computes y_k in the doStep that starts at t_k,
from the inputs at t_k: it lists these inputs, which determine the order of blocks within a tick.
Inputs set after the doStep have no effect, so that strictly the list is longer than necessary,
which FMI allows. `InitialUnknowns` lists inputs and parameters, through x0 = initialize(u, p).
Outputs of sampled blocks have variability "discrete".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict
from xml.etree import ElementTree as ET

import casadi as ca

from hapticlink.components.component import Component, Variable
from hapticlink.components.ports import Power, Spring
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.units import base_unit
from hapticlink.fmus.versions import version

CAPABILITIES = {
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
LOG_CATEGORIES = {
    "logStatusWarning": "Messages with status warning.",
    "logStatusDiscard": "Messages with status discard.",
    "logStatusError": "Messages with status error.",
    "logStatusFatal": "Messages with status fatal.",
    "logAll": "All messages.",
}


def of_maker() -> dict[str, str]:
    """The attributes of a model description that name who has made the FMU, with what."""
    return {
        "author": "The hapticlink authors",
        "version": version("hapticlink"),
        "copyright": "(c) 2026 The hapticlink authors",
        "license": "MIT",
        "generationTool": f"hapticlink {version('hapticlink')}",
    }


def model_description(
    component: Component, guid: str, *, stop_time: float, step_size: float, needs_tool: bool = True
) -> bytes:
    """The XML text, without a date, so that the same arguments give the same bytes.

    needs_tool: whether the FMU needs Python (needsExecutionTool). Raises FmuError for a declared
    derivative that is not of the shape of its output, InvalidUnit for a unit.
    """
    of_component = {
        "fmiVersion": "2.0",
        "modelName": component.name,
        "guid": guid,
        "description": component.description,
    }
    naming = {"variableNamingConvention": "structured"}
    root = ET.Element("fmiModelDescription", of_component | of_maker() | naming)
    runs = {"modelIdentifier": component.name, "needsExecutionTool": str(needs_tool).lower()}
    ET.SubElement(root, "CoSimulation", runs | CAPABILITIES)
    _unit_definitions(root, component)
    categories = ET.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=text)
    ET.SubElement(
        root,
        "DefaultExperiment",
        startTime="0.0",
        stopTime=repr(float(stop_time)),
        stepSize=repr(float(step_size)),
    )
    _annotation(root, component)
    _model_variables(root, component)
    _model_structure(root, component)
    return as_text(root)


def with_sources(xml: bytes, names: Iterable[str]) -> bytes:
    """A model description that lists the C files in sources/ to compile (FMI 2.0.5, 4.3.1)."""
    root = ET.fromstring(xml)
    simulation = root.find("CoSimulation")
    assert simulation is not None
    listed = ET.SubElement(simulation, "SourceFiles")
    for name in names:
        ET.SubElement(listed, "File", name=name)
    return as_text(root)


def as_text(root: ET.Element) -> bytes:
    """The indented XML text."""
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def _annotation(root: ET.Element, component: Component) -> None:
    """The vendor annotation: timing, and declarations about ports (`components.ports`)."""
    tool = ET.SubElement(ET.SubElement(root, "VendorAnnotations"), "Tool", name="hapticlink")
    about = {"timing": component.timing, "substeps": str(component.substeps)}
    block = ET.SubElement(tool, "Block", about)
    for v in component.inputs:
        if v.power:
            ET.SubElement(block, "Port", {"name": v.name} | _attributes(v.power))
    for v in component.outputs:
        if v.kind:
            ET.SubElement(block, "Port", name=v.name, kind=v.kind)
    for spring in component.springs:
        ET.SubElement(block, "Spring", _attributes(spring))
    states = (name for v in component.states for name in v.names)
    ET.SubElement(block, "States", names=" ".join(states))


def _attributes(record: Power | Spring) -> dict[str, str]:
    return {name: str(value) for name, value in asdict(record).items() if value != ""}


def _unit_definitions(root: ET.Element, component: Component) -> None:
    variables = (*component.inputs, *component.parameters, *component.outputs)
    units = sorted({unit for v in variables for unit in v.units})
    if units:
        definitions = ET.SubElement(root, "UnitDefinitions")
        for unit in units:
            element = ET.SubElement(definitions, "Unit", name=unit)
            exponents = {base: str(power) for base, power in base_unit(unit).items()}
            ET.SubElement(element, "BaseUnit", exponents)


def scalars(variables: Iterable[Variable]) -> Iterator[tuple[Variable, str, str, float]]:
    """Variable, name, unit and start value of each scalar in flat order."""
    for v in variables:
        for name, unit, start in zip(v.names, v.units, v.starts, strict=True):
            yield v, name, unit, start


def _model_variables(root: ET.Element, component: Component) -> None:
    parent = ET.SubElement(root, "ModelVariables")

    def add(v: Variable, name: str, unit: str, start: float | None, **attributes: str) -> None:
        if v.description:
            attributes["description"] = v.description
        scalar = ET.SubElement(
            parent,
            "ScalarVariable",
            {"name": name, "valueReference": str(len(parent)), **attributes},
        )
        real = ET.SubElement(scalar, "Real", unit=unit)
        if start is not None:
            real.set("start", repr(float(start)))
        if v.max is not None:
            real.set("max", repr(float(v.max)))

    for v, name, unit, start in scalars(component.inputs):
        add(v, name, unit, start, causality="input", variability="continuous")
    for v, name, unit, start in scalars(component.parameters):
        add(v, name, unit, start, causality="parameter", variability=v.variability, initial="exact")
    kind = "discrete" if component.timing == "sampled" else "continuous"
    for v, name, unit, _ in scalars(component.outputs):
        add(v, name, unit, None, causality="output", variability=kind, initial="calculated")
    _derivatives(parent, component)


def _derivatives(variables: ET.Element, component: Component) -> None:
    """Adds the attribute `derivative` to outputs that are derivatives (FMI 2.0.5 section 2.2.7)."""
    index = {scalar.get("name"): i for i, scalar in enumerate(variables)}
    outputs = {v.name: v for v in component.outputs}
    for v in (v for v in component.outputs if v.derivative_of):
        of = outputs.get(v.derivative_of or "")
        if of is None or of.shape != v.shape:
            raise FmuError(
                f"`{component.name}`: `{v.name}` is declared the derivative of "
                f"`{v.derivative_of}`, which is no output of its shape"
            )
        for name, whole in zip(v.names, of.names, strict=True):
            variables[index[name]][0].set("derivative", str(index[whole] + 1))


def _model_structure(root: ET.Element, component: Component) -> None:
    structure = ET.SubElement(root, "ModelStructure")
    known = len(component.start_inputs) + len(component.start_parameters)
    for tag, dependencies in (
        ("Outputs", feed_through(component)),
        ("InitialUnknowns", initial_dependencies(component)),
    ):
        if dependencies:
            parent = ET.SubElement(structure, tag)
            for k, columns in enumerate(dependencies):
                indices = " ".join(str(column + 1) for column in columns)
                ET.SubElement(parent, "Unknown", index=str(known + k + 1), dependencies=indices)


def feed_through(component: Component) -> list[list[int]]:
    """For each flat output, the flat inputs that y = output(x, u, p, t) depends on."""
    return _rows(component.output.jac_sparsity(0, 1))


def initial_dependencies(component: Component) -> list[list[int]]:
    """For each flat output, the indices in [inputs | parameters] that it depends on at t = 0."""
    n_u, n_p = len(component.start_inputs), len(component.start_parameters)
    known, t = ca.SX.sym("known", n_u + n_p), ca.SX.sym("t")
    u, p = known[:n_u], known[n_u:]
    y = component.output(component.initialize(u, p), u, p, t)
    return _rows(ca.Function("initial", [known, t], [y]).jac_sparsity(0, 0))


def _rows(sparsity: ca.Sparsity) -> list[list[int]]:
    rows: list[list[int]] = [[] for _ in range(sparsity.size1())]
    for row, column in zip(*sparsity.get_triplet(), strict=True):
        rows[row].append(column)
    return [sorted(columns) for columns in rows]
