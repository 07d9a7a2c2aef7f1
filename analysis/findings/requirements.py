"""The parts of the equations that a scene needs, and those left out because nothing uses them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hapticlink.components.contact.broad_phase import near, out_of_reach
from hapticlink.components.linkage.model import count_rows
from hapticlink.orchestrator.base.signal_names import ENVIRONMENT
from hapticlink.orchestrator.scene.blocks import from_graphics, impedance, topology
from hapticlink.orchestrator.scene.scene import Scene


@dataclass(frozen=True)
class Need:
    """A part of the equations, whether the scene has it, and why."""

    part: str
    needed: bool
    why: str


def needs(scene: Scene) -> Iterator[Need]:
    """Every optional part of the equations, for a scene with a linkage."""
    if scene.linkage is None:
        return
    count = count_rows(scene.linkage)
    yield Need(
        "loop closures",
        count > 0,
        f"{count} multipliers" if count else "no loop: no multiplier, no projection",
    )
    yield from _forces(scene)
    yield from _contacts(scene)
    yield Need(
        "Lambda_inv",
        impedance(scene),
        f"from {scene.directions_from}" if impedance(scene) else "no impedance controller",
    )
    yield Need(
        "constrained directions",
        topology(scene) or scene.mechanism.directions,
        f"from {scene.directions_from}" if topology(scene) else "no topology controller",
    )
    reasons = from_graphics(scene).names
    yield Need(
        ENVIRONMENT,
        bool(reasons and scene.graphics),
        f"for {', '.join(reasons)}" if reasons else "nothing depends on it",
    )
    text = "D, W, w, J_h held from graphics" if scene.local_model else "own matrices at every step"
    yield Need("local model", scene.local_model, text)


def _forces(scene: Scene) -> Iterator[Need]:
    assert scene.linkage is not None
    given = {
        "joint limits": scene.linkage.limited,
        "gravity": scene.linkage.gravity is not None,
        "springs and dampers": scene.linkage.sprung,
        "friction": scene.linkage.rubbing > 0,
        "drives": scene.linkage.driven,
        "forces of your own": bool(scene.linkage.force),
    }
    for part, needed in given.items():
        yield Need(part, needed, "in [linkage]" if needed else "not mentioned: no term")


def _contacts(scene: Scene) -> Iterator[Need]:
    assert scene.linkage is not None
    if scene.contacts is None:
        yield Need("contacts", False, "no [contacts]: no contact port, no detection")
        return
    close_pairs = near(scene.linkage, scene.contacts)
    places = sum(pair.places for pair in close_pairs)
    pairs = f"{len(close_pairs)} pair{'s' * (len(close_pairs) != 1)}"
    text = f"{pairs}, {places} place{'s' * (places != 1)}, detected by {scene.contacts.detection}"
    yield Need("contacts", bool(close_pairs), text)
    for pair in out_of_reach(scene.linkage, scene.contacts):
        yield Need(f"{pair.body} on {pair.obstacle}", False, "out of reach: no narrow phase")
