"""Scenes that can be tuned, and the rates at which their gains are judged."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene.scene import Scene

NEAR = {"haptics": (0.75, 1.25), "graphics": (0.5, 2.0)}
"""Neighbouring rates, as factors."""


def required(read: Scene) -> Linkage:
    """The linkage of a scene. Raises InputFault where there are no gains to tune, or where they are
    not felt."""
    if not (read.linkage and read.controller and read.device and read.hand):
        raise InputFault(
            "no gains to tune: a [linkage], [device], [controller] and [hand] are needed"
        )
    if read.sensing == "ideal":
        raise InputFault(
            "with ideal sensing the motors cancel the hand's wrench along a joint constraint: it "
            "feels rigid whatever the gains; take --set sensing=encoders"
        )
    if read.contacts and not read.controller.contact:
        raise InputFault("contacts are not sent to the hand: take --set controller.contact=true")
    return read.linkage


def near_rates(read: Scene) -> Iterator[str]:
    """Options with a neighbouring rate each."""
    for key, factors in NEAR.items():
        if (part := getattr(read, key)) is not None:
            for factor in factors:
                yield f"{key}.rate={round(float(exact(part.rate)) * factor)}"
