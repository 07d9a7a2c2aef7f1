"""The communication step sizes of an SSP, which the standard leaves out, where other tools look for
them: libcosim and Ecos in annotations of the Open Simulation Platform, OMSimulator in its own."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from hapticlink.orchestrator.ssp.names import SSC, SSD
from hapticlink.orchestrator.system.system import Fmu, System

OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"


def of_component(component: Element, system: System, fmu: Fmu) -> None:
    """The step of one FMU (s)."""
    annotation = _annotation(component, "com.opensimulationplatform")
    SubElement(annotation, f"{{{OSP}}}StepSizeHint", value=_seconds(system, fmu))


def of_system(element: Element, system: System) -> None:
    """The smallest step of all FMUs (s), as OMSimulator's master takes it."""
    annotations = SubElement(_annotation(element, "org.openmodelica"), f"{{{OMS}}}Annotations")
    information = SubElement(annotations, f"{{{OMS}}}SimulationInformation")
    master = {"description": "oms-ma", "stepSize": _smallest(system)}
    tolerances = {"absoluteTolerance": "0.0001", "relativeTolerance": "0.0001"}
    SubElement(information, f"{{{OMS}}}FixedStepMaster", master | tolerances)


def of_experiment(experiment: Element, system: System) -> None:
    """The smallest step of all FMUs (s), as libcosim's fixed-step algorithm takes it."""
    annotation = _annotation(experiment, "com.opensimulationplatform")
    algorithm = SubElement(annotation, f"{{{OSP}}}Algorithm")
    SubElement(algorithm, f"{{{OSP}}}FixedStepAlgorithm", baseStepSize=_smallest(system))


def _annotation(element: Element, kind: str) -> Element:
    annotations = SubElement(element, f"{{{SSD}}}Annotations")
    return SubElement(annotations, f"{{{SSC}}}Annotation", type=kind)


def _seconds(system: System, fmu: Fmu) -> str:
    timeline = system.timeline
    return repr(timeline.seconds(timeline.clock(fmu.clock).longest))


def _smallest(system: System) -> str:
    return min((_seconds(system, fmu) for fmu in system.fmus), key=float)
