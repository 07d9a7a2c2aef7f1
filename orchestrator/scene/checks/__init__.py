"""Semantic checks of a scene: names that must exist, numbers that limit each other, tables that
need each other. Each check yields (path in the file, message with remedy)."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.orchestrator.scene.checks import (
    blocks,
    contacts,
    coupling,
    device,
    fmus,
    linkage,
    rates,
)
from hapticlink.orchestrator.scene.conditions import parse_condition
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Problem


def check(scene: Scene) -> list[Problem]:
    """Every problem found."""
    found = [
        *_condition(scene),
        *rates.check(scene),
        *coupling.delays(scene),
        *blocks.missing(scene),
    ]
    found += fmus.check(scene)
    if scene.linkage:
        found += linkage.check(scene.linkage)
    found += contacts.check(scene)
    found += device.check(scene)
    found += coupling.check(scene)
    found += blocks.check(scene)
    return found


def _condition(scene: Scene) -> Iterator[Problem]:
    if scene.stop_when:
        try:
            parse_condition(scene.stop_when)
        except ValueError as error:
            yield ("stop_when",), str(error)
