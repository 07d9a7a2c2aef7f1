"""Dyads of a device: how its bodies follow, two at a time, from where its handle is.

A dyad (an Assur group of the second class) is two bodies that a pin joins, the elbow, each with
another pin whose place is known: then both are a triangle of known sides. Known are at first the
ground and the handle, its body where its angle is held, and its point alone where that is free.
Each dyad makes further bodies and pins known; where some body is left, there is no such way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hapticlink.components.linkage.parameters import loop_name
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.quantities import Place

GROUND = "ground"


@dataclass(frozen=True)
class PinPlace:
    """A point of a body: the name of the parameter with its position, which may not exist."""

    body: str
    parameter: str


@dataclass(frozen=True)
class Anchor:
    """A pin of a dyad's body whose place is known: where that is from, None for the handle's
    point, and its place on the dyad's body."""

    known: PinPlace | None
    on: PinPlace


@dataclass(frozen=True)
class Dyad:
    """Two bodies, each with its anchor and its place of the elbow."""

    first: Anchor
    first_elbow: PinPlace
    second: Anchor
    second_elbow: PinPlace

    @property
    def bodies(self) -> tuple[str, str]:
        return self.first_elbow.body, self.second_elbow.body


class Pins:
    """The pins of a device: the places of all bodies that each joins."""

    def __init__(self, device: Device) -> None:
        self._positions: dict[PinPlace, Place] = {}
        self.handle = PinPlace(device.handle.body, "operational_point.at")
        pairs = [[(self.handle, device.handle.at)]]
        for j in device.placed:
            ends = (j.parent, "at_parent", j.at_parent), (j.child, "at_child", j.at_child)
            pairs.append([(PinPlace(body, f"{j.name}.{key}"), at) for body, key, at in ends])
        for i, loop in enumerate(device.placed_loops):
            both = enumerate(zip(loop.bodies, loop.at, strict=True), 1)
            name = loop_name(device.linkage, i)
            pairs.append([(PinPlace(body, f"{name}.at{k}"), at) for k, (body, at) in both])
        self.all: list[list[PinPlace]] = []
        for pair in pairs:
            self._positions |= {place: at or (0.0, 0.0) for place, at in pair}
            self._join([place for place, _ in pair])

    def _join(self, pair: list[PinPlace]) -> None:
        """Adds a pin, or the places of one to a pin at the same point of a body."""
        joined = [pin for pin in self.all if any(self._same(a, b) for a in pin for b in pair)]
        self.all = [pin for pin in self.all if pin not in joined]
        self.all.append([*(place for pin in joined for place in pin), *pair])

    def _same(self, a: PinPlace, b: PinPlace) -> bool:
        return a.body == b.body and self._positions[a] == self._positions[b]


def dyads(device: Device) -> list[Dyad] | None:
    """The dyads of a device in the order in which they are solved; None where they do not reach
    every body, and of a device in space."""
    planar = device.linkage.dimension == 2
    if not planar or device.handle.along or any(j.type != "revolute" for j in device.placed):
        return None
    pins = Pins(device)
    held = device.handle.angle == "held"
    known = {GROUND, *([device.handle.body] if held else [])}
    waiting = [body.name for body in device.body if body.name not in known]
    found: list[Dyad] = []
    while waiting:
        dyad = next(_solvable(pins, known, waiting), None)
        if dyad is None:
            return None
        found.append(dyad)
        known.update(dyad.bodies)
        waiting = [body for body in waiting if body not in known]
    return found


def _solvable(pins: Pins, known: set[str], waiting: list[str]) -> Iterator[Dyad]:
    """The dyads of waiting bodies whose anchors are known."""
    for first in waiting:
        for elbow in pins.all:
            on_first = next((place for place in elbow if place.body == first), None)
            for on_second in elbow:
                second = on_second.body
                if on_first is None or second == first or second not in waiting:
                    continue
                a, c = (_anchor(pins, known, body, elbow) for body in (first, second))
                if a and c:
                    yield Dyad(a, on_first, c, on_second)


def _anchor(pins: Pins, known: set[str], body: str, elbow: list[PinPlace]) -> Anchor | None:
    """A pin of a body, other than the elbow, whose place is known."""
    for pin in pins.all:
        on = next((place for place in pin if place.body == body), None)
        if on is None or pin is elbow:
            continue
        if pins.handle in pin:
            return Anchor(None, on)
        at = next((place for place in pin if place.body in known), None)
        if at is not None:
            return Anchor(at, on)
    return None
