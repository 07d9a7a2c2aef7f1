"""What the description of an FMU says, and its parts that FMI 2.0 and 3.0 have in common.

Dependencies of a component are structural, from CasADi's sparsity. At a communication point an
output of a continuous block depends on the inputs of y = output(x, u, p, t). A sampled block
computes y_k in the doStep that starts at t_k, from the inputs at t_k: these are listed, since they
determine the order of blocks within a tick. Inputs set after the doStep have no effect, so that
strictly the list is longer than necessary, which FMI allows. At the start outputs depend on inputs
and parameters, through x0 = initialize(u, p).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

from hapticlink.components.component import Component
from hapticlink.components.ports import Gradient, Power, SpringPorts
from hapticlink.fmus.scalar_variables import (
    ScalarVariable,
    initial_dependencies,
    scalar_variables,
)
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


@dataclass(frozen=True)
class Described:
    """What the description of an FMU says, whatever the version of the standard."""

    name: str
    """Its model name and identifier."""
    description: str
    variables: Sequence[ScalarVariable]
    """By value reference."""
    units: Mapping[str, Mapping[str, str] | None]
    """By name of a unit the attributes of its BaseUnit, None where that is not known."""
    stop_time: float
    step_size: float
    """Of the default experiment (s)."""
    capabilities: Mapping[str, str]
    """As FMI 2.0 calls them."""
    naming: str = "structured"
    needs_tool: bool = False
    """Whether the FMU needs Python (needsExecutionTool)."""
    initial: Mapping[str, Sequence[str]] | None = None
    """By output what it depends on at the start; None: on any that is set."""
    component: Component | None = None
    """The block of which it has the vendor annotation."""

    @property
    def attributes(self) -> dict[str, str]:
        """Of the root element."""
        return {
            "modelName": self.name,
            "description": self.description,
            "author": "The hapticlink authors",
            "version": version("hapticlink"),
            "copyright": "(c) 2026 The hapticlink authors",
            "license": "MIT",
            "generationTool": f"hapticlink {version('hapticlink')}",
            "variableNamingConvention": self.naming,
        }

    @property
    def implementation(self) -> dict[str, str]:
        tool = str(self.needs_tool).lower()
        return {"modelIdentifier": self.name, "needsExecutionTool": tool}


def describe_component(
    component: Component,
    needs_tool: bool = True,
    /,
    *,
    stop_time: float = 1.0,
    step_size: float = 1 / 512,
) -> Described:
    """A component. stop_time and step_size (s): of the default experiment. Raises FmuError for a
    declared derivative that is not of the shape of its output, InvalidUnit for a unit."""
    variables = scalar_variables(component)
    outputs = [v.name for v in variables if v.kind == "OUTPUT"]
    at_start = initial_dependencies(component)
    return Described(
        component.name,
        component.description,
        variables,
        {v.unit: base_attributes(v.unit) for v in variables},
        stop_time,
        step_size,
        CAPABILITIES,
        needs_tool=needs_tool,
        initial={
            name: [variables[i].name for i in known]
            for name, known in zip(outputs, at_start, strict=True)
        },
        component=component,
    )


def base_attributes(unit: str) -> dict[str, str]:
    """The attributes of the BaseUnit of a unit. Raises InvalidUnit."""
    return {base: str(power) for base, power in base_unit(unit).items()}


def icon(about: Described) -> bytes:
    """A sampled and held wave for a sampled block, a smooth one for any other."""
    sampled = about.component and about.component.timing == "sampled"
    name = "sampled" if sampled else "continuous"
    return (Path(__file__).parent / "icons" / f"{name}.png").read_bytes()


def as_text(root: ET.Element) -> bytes:
    """The indented XML text."""
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def definitions(root: ET.Element, about: Described) -> None:
    """Units, categories of messages and the default experiment, as FMI 2.0 and 3.0 have them."""
    units = sorted((name, base) for name, base in about.units.items() if name)
    parent = ET.SubElement(root, "UnitDefinitions") if units else root
    for name, base in units:
        element = ET.SubElement(parent, "Unit", name=name)
        if base is not None:
            ET.SubElement(element, "BaseUnit", dict(base))
    categories = ET.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=text)
    times = {"startTime": 0.0, "stopTime": about.stop_time, "stepSize": about.step_size}
    ET.SubElement(root, "DefaultExperiment", {k: repr(float(t)) for k, t in times.items()})


def annotation(component: Component) -> ET.Element:
    """The vendor annotation: timing, and declarations about ports (`components.ports`)."""
    about = {"timing": component.timing, "substeps": str(component.substeps)}
    block = ET.Element("Block", about)
    for v in component.inputs:
        if v.power:
            ET.SubElement(block, "Port", {"name": v.name} | _attributes(v.power))
    for v in component.outputs:
        if v.kind:
            ET.SubElement(block, "Port", name=v.name, kind=v.kind)
        if v.gradient:
            ET.SubElement(block, "Gradient", {"name": v.name} | _attributes(v.gradient))
    for spring in component.springs:
        ET.SubElement(block, "Spring", _attributes(spring))
    states = (name for v in component.states for name in v.names)
    ET.SubElement(block, "States", names=" ".join(states))
    return block


def _attributes(record: Power | Gradient | SpringPorts) -> dict[str, str]:
    return {name: str(value) for name, value in asdict(record).items() if value != ""}
