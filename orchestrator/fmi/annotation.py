"""The vendor annotation of an FMU: what its ports mean beyond FMI.

    <Tool name="hapticlink">
      <Block timing="sampled" substeps="1">
        <Port name="F" displacement="x" sign="-1.0"/>
        <Port name="P" kind="projector"/>
      <Port name="x" units="m m rad"/>
        <Spring set_position="x_S" position="x_D" stiffness="K" damping="B" set_velocity="v_S"/>
        <States names="q[1] q[2]"/>
      </Block>
    </Tool>

The attributes of ports and springs are those of the records in `components.ports`. States declares
the layout of the serialised FMU state: it ends with doubles in the machine's byte order, the values
of all variables by value reference, and then these states. FMI 3.0 has one unit for an array:
`units` are those of its entries; there the Block stands in an Annotation of type hapticlink. An FMU
without this annotation declares none of it, whatever its ports are called; any FMU may carry it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, get_args
from xml.etree.ElementTree import Element

from hapticlink.components.ports import Gradient, Kind, Power, SpringPorts
from hapticlink.orchestrator.base.errors import unknown
from hapticlink.orchestrator.fmi.units import Unit, why_unsuitable
from hapticlink.orchestrator.fmi.variables import Scalar

TIMINGS = ("continuous", "sampled", "frame")
SPRING_ENDS = {
    "set_position": ("input",),
    "position": ("input", "output"),
    "set_velocity": ("input",),
    "velocity": ("input", "output"),
    "force": ("output",),
}
"""The ports of a spring-damper, and what they may be."""


def block(tree: Element) -> Element | None:
    """The annotation's Block in a modelDescription.xml, None where there is none."""
    two = tree.find("./VendorAnnotations/Tool[@name='hapticlink']/Block")
    three = tree.find("./Annotations/Annotation[@type='hapticlink']/Block")
    return three if two is None else two


def with_units(tree: Element, scalars: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """The scalars with the units that the annotation gives to the entries of arrays. Raises
    ValueError where there are not as many."""
    declared = () if (about := block(tree)) is None else about.iterfind("Port[@units]")
    units = {port.get("name", ""): port.get("units", "").split() for port in declared}
    entries = Counter(s.port for s in scalars)
    for name, given in units.items():
        if len(given) != entries[name]:
            raise ValueError(f"{name} has {entries[name]} entries, and {len(given)} units")
    return tuple(replace(s, unit=units[s.port][s.entry]) if s.port in units else s for s in scalars)


def read_annotation(
    tree: Element, scalars: Iterable[Scalar], units: Mapping[str, Unit]
) -> dict[str, Any]:
    """What the annotation of an FMU says, as fields of `Description`. Raises ValueError if it is
    malformed, or does not fit the variables and their units."""
    if (declared := block(tree)) is None:
        return {"timing": "continuous"}
    timing = declared.get("timing")
    if timing is not None:
        _one_of(timing, "timing", TIMINGS)
    ports = _Ports(scalars, units)
    kinds: dict[str, Kind] = {}
    power: dict[str, Power] = {}
    gradients: dict[str, Gradient] = {}
    springs: list[SpringPorts] = []
    states: tuple[str, ...] | None = None
    for element in declared:
        _one_of(element.tag, "element", ("Port", "Gradient", "Spring", "States"))
        name = element.get("name", "")
        if element.tag == "States":
            states = tuple(_attributes(element, "names")["names"].split())
        elif element.tag == "Gradient":
            gradients[name] = ports.gradient(element)
        elif element.tag == "Spring":
            springs.append(ports.spring(element))
        elif "units" in element.attrib:
            _attributes(element, "name units")
        elif "kind" in element.attrib:
            kinds[name] = ports.kind(element)
        else:
            power[name] = ports.power(element)
    return {
        "timing": timing or "continuous",
        "declares_timing": bool(timing),
        "kinds": kinds,
        "power": power,
        "gradients": gradients,
        "springs": tuple(springs),
        "states": states,
    }


class _Ports:
    """The ports of an FMU, with checks of what is declared of each."""

    def __init__(self, scalars: Iterable[Scalar], units: Mapping[str, Unit]) -> None:
        self._scalars, self._units = tuple(scalars), units

    def kind(self, element: Element) -> Kind:
        given = _attributes(element, "name kind")
        entries = self._entries(given["name"], "output")
        kind: Any = _one_of(given["kind"], "kind", get_args(Kind))
        names = [s.unit for s in entries]
        if why := why_unsuitable(kind, [self._units.get(n, Unit(n)) if n else None for n in names]):
            raise ValueError(f"{given['name']} {why}")
        return kind

    def power(self, element: Element) -> Power:
        given = _attributes(element, "name displacement", "sign")
        size = len(self._entries(given["name"], "input"))
        self._entries(given["displacement"], "output", size=size)
        sign = float(given.get("sign", "1"))
        if abs(sign) != 1.0:
            raise ValueError(f"{given['name']}: sign {sign:g} is neither 1 nor -1")
        return Power(given["displacement"], sign)

    def gradient(self, element: Element) -> Gradient:
        given = _attributes(element, "name of at by")
        found = Gradient(given["of"], given["at"], given["by"])
        size = len(self._entries(found.by, "input"))
        self._entries(found.at, "output", size=size)
        size *= len(self._entries(found.of, "output"))
        self._entries(given["name"], "output", size=size)
        return found

    def spring(self, element: Element) -> SpringPorts:
        needed = "set_position position stiffness"
        further = "damping set_velocity velocity force mobility"
        spring = SpringPorts(**_attributes(element, needed, further))
        size = len(self._entries(spring.set_position, "input"))
        if spring.mobility:
            self._entries(spring.mobility, "input", size=size * size)
        gains = dict.fromkeys(("stiffness", "damping"), ("parameter",))
        for name, causalities in (SPRING_ENDS | gains).items():
            if port := getattr(spring, name):
                self._entries(port, *causalities, size=size)
        return spring

    def _entries(self, name: str, *causalities: str, size: int = 0) -> list[Scalar]:
        entries = [s for s in self._scalars if s.port == name and s.causality in causalities]
        if not entries:
            raise ValueError(f"there is no {' or '.join(causalities)} {name!r}")
        if size and len(entries) != size:
            raise ValueError(f"{name} has {len(entries)} entries, and {size} are needed")
        return entries


def _attributes(element: Element, needed: str, further: str = "") -> dict[str, str]:
    given, known = dict(element.attrib), f"{needed} {further}".split()
    for name in given:
        _one_of(name, "attribute", known)
    for name in needed.split():
        if name not in given:
            raise ValueError(f"{element.tag} {given}: {name} is missing")
    return given


def _one_of(value: str, what: str, known: Iterable[str]) -> str:
    if value not in known:
        raise ValueError(unknown(what, value, known))
    return value
