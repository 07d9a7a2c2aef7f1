"""Semantic checks of a scene: names that must exist, numbers that limit each other, tables that
need each other. Each check yields (path in the file, message with remedy)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, islice

from hapticlink.components.specs.contacts import ContactsOfAllPairs
from hapticlink.orchestrator.base.errors import COUNTED
from hapticlink.orchestrator.scene.blocks import blocks as plan_blocks
from hapticlink.orchestrator.scene.checks import (
    blocks,
    contacts,
    devices,
    fmus,
    linkage,
    numbers,
    space,
)
from hapticlink.orchestrator.scene.conditions import parse_condition
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Problem


def check_scene(scene: Scene) -> list[Problem]:
    """Every problem found, up to COUNTED: each may search for a similar name."""
    of_linkage = linkage.check_linkage(scene.linkage, scene.graphics) if scene.linkage else ()
    found = (space.check_space(scene), of_linkage, contacts.check_contacts(scene))
    shapes = list(islice(chain(*found), COUNTED))
    if shapes and scene.contacts:
        # The broad phase needs a valid tree and valid polygons.
        scene = replace(scene, contacts=ContactsOfAllPairs(**vars(scene.contacts)))
    planned = plan_blocks(scene)
    rest = chain(
        _condition(scene),
        numbers.check_rates(scene, planned),
        numbers.check_delays(scene),
        blocks.check_needed_tables(scene),
        fmus.check_fmus(scene, planned),
        shapes,
        devices.check_devices(scene),
        numbers.check_numbers(scene),
        blocks.check_blocks(scene, planned),
    )
    return list(islice(rest, COUNTED))


def _condition(scene: Scene) -> Iterator[Problem]:
    if scene.stop_when:
        try:
            parse_condition(scene.stop_when)
        except ValueError as error:
            yield ("stop_when",), str(error)
