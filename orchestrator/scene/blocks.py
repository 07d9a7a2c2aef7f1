"""The blocks that a scene needs: which FMUs are built, with which settings, at which rate."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

from hapticlink.components.contact.broad_phase import near
from hapticlink.components.specs.control import Controller
from hapticlink.components.specs.linkage import GraphicsCopy
from hapticlink.orchestrator.base.loop_names import (
    CONTROLLER,
    DEVICE,
    ENVIRONMENT,
    HAND,
    MECHANISM,
    block_of_user,
)
from hapticlink.orchestrator.scene.rates import AnyRate
from hapticlink.orchestrator.scene.scene import Scene


@dataclass(frozen=True)
class BlockPlan:
    """A block of the scene with its settings and its rate; "haptics" or "graphics" for blocks of
    the haptic loop."""

    name: str
    rate: AnyRate
    settings: dict[str, Any]
    kind: str = ""

    @property
    def made_by(self) -> str:
        """The name in `components.blocks.BLOCKS` of the function that builds it."""
        return self.kind or self.name


def blocks(scene: Scene, *, skip: bool = True) -> tuple[BlockPlan, ...]:
    """All blocks that are built into FMUs: those of the haptic loop, then those of [[fmu]] tables.

    skip=False includes what nothing in the scene uses.
    """
    rates = fmu_rates(scene)
    named = (
        BlockPlan(f.name, rates[f.name], dict(f.settings), f.block) for f in scene.fmu if f.block
    )
    return (*loop_blocks(scene, skip=skip), *named)


def loop_blocks(scene: Scene, *, skip: bool = True) -> tuple[BlockPlan, ...]:
    """The blocks of the haptic loop that no FMU replaces, in its order; skip=False includes what
    nothing uses."""
    replacing = {f.replaces for f in scene.fmu}
    return tuple(b for b in _loop(scene, skip) if b.name not in replacing)


def replaced_blocks(scene: Scene) -> dict[str, BlockPlan]:
    """The blocks of the haptic loop that an FMU of the scene replaces, by name."""
    replacing = {f.replaces for f in scene.fmu}
    return {b.name: b for b in _loop(scene, True) if b.name in replacing}


def loop_names(scene: Scene) -> list[str]:
    """The names of the loop's blocks in its order, replaced ones among them."""
    return [b.name for b in _loop(scene, True)]


def _loop(scene: Scene, skip: bool) -> tuple[BlockPlan, ...]:
    if not skip:
        scene = unskipped(scene)
    found = []
    if scene.hand:
        found.append(BlockPlan(HAND, "haptics", {"hand": scene.hand}))
    for name, hand in scene.hands.items():
        found.append(BlockPlan(block_of_user(HAND, name), "haptics", {"hand": hand}, HAND))
    if scene.controller:
        settings = settings_of(scene, "controller", "directions", "linkage")
        if others(scene):
            settings["controller"] = replace(scene.controller, contact=True)
        found.append(BlockPlan(CONTROLLER, "haptics", settings))
    for name, controller in scene.users.items():
        felt = replace(controller, contact=True)
        settings = {**settings_of(scene, "directions", "linkage"), "controller": felt}
        found.append(BlockPlan(block_of_user(CONTROLLER, name), "haptics", settings, CONTROLLER))
    if scene.device:
        found.append(BlockPlan(DEVICE, "haptics", {"device": scene.device}))
    for name, device in scene.devices.items():
        plan = BlockPlan(block_of_user(DEVICE, name), "haptics", {"device": device}, DEVICE)
        found.append(plan)
    if scene.linkage:
        settings = {"linkage": scene.linkage, "mechanism": scene.mechanism}
        if scene.directions_from == "mechanism" or scene.mechanism.directions:
            settings["directions"] = scene.directions
        if scene.contacts:
            settings["contacts"] = scene.contacts
        if scene.controller and others(scene):
            settings["felt"] = True
        if scene.devices:
            settings["users"] = tuple(scene.devices)
        if scene.contacts or scene.linkage.limited or (others(scene) and controllers(scene)):
            settings["length_scale"] = scene.directions.length_scale
        if scene.local_model:
            settings["local_model"] = True
        found.append(BlockPlan(MECHANISM, scene.mechanism_at, settings))
    if scene.linkage and scene.graphics and (graphics_block(scene) or not skip):
        names = (f.name for f in fields(GraphicsCopy))
        copy = GraphicsCopy(**{name: getattr(scene.graphics, name) for name in names})
        settings = {
            "linkage": scene.linkage,
            "graphics": copy,
            "directions": (
                scene.directions if directions_from_graphics(scene) or not skip else None
            ),
            "contacts": scene.contacts if contacts_from_graphics(scene) else None,
            "mobility": mobility_from_graphics(scene) or not skip,
            "local_model": scene.local_model,
        }
        if scene.devices:
            settings["users"] = tuple(scene.devices)
        found.append(BlockPlan(ENVIRONMENT, "graphics", settings))
    return tuple(found)


def settings_of(scene: Scene, *parts: str) -> dict[str, Any]:
    return {part: getattr(scene, part) for part in parts}


def controllers(scene: Scene) -> list[Controller]:
    return [*([scene.controller] if scene.controller else []), *scene.users.values()]


def fmu_rates(scene: Scene) -> dict[str, AnyRate]:
    """The rate of each FMU by its name: of the scene's blocks, then of [[fmu]] tables."""
    replaced = {name: b.rate for name, b in replaced_blocks(scene).items()}
    foreign = {f.name: f.rate or replaced.get(f.name, "haptics") for f in scene.fmu}
    return {b.name: b.rate for b in loop_blocks(scene)} | foreign


def impedance(scene: Scene) -> bool:
    return any(controller.impedance for controller in controllers(scene))


def topology(scene: Scene) -> bool:
    return any(controller.topology is not False for controller in controllers(scene))


def mobility_from_graphics(scene: Scene) -> bool:
    return scene.directions_from == "graphics" and impedance(scene)


def directions_from_graphics(scene: Scene) -> bool:
    """Whether the virtual environment computes P_c: for the controller, or as an output that the
    scene requests beside the mobility."""
    wanted = topology(scene) or (impedance(scene) and scene.mechanism.directions)
    return scene.directions_from == "graphics" and wanted


def others(scene: Scene) -> bool:
    """Whether others than the hand act on the mechanism: hands at further points, or efforts on its
    joints."""
    linkage = scene.linkage
    return bool(linkage and (linkage.point or any("effort" in j.ports for j in linkage.joint)))


def contacts_from_graphics(scene: Scene) -> bool:
    """Whether the mechanism's contact geometry comes from the virtual environment."""
    if not scene.contacts or not scene.linkage or scene.contacts.detection != "graphics":
        return False
    return bool(near(scene.linkage, scene.contacts))


def graphics_block(scene: Scene) -> list[str]:
    """What the virtual environment computes for other blocks; empty where it is not needed."""
    reasons = {
        "Lambda_inv": mobility_from_graphics(scene),
        "P_c": directions_from_graphics(scene),
        "contact geometry": contacts_from_graphics(scene),
        "the local model": scene.local_model,
    }
    return [name for name, wanted in reasons.items() if wanted]


def unskipped(scene: Scene) -> Scene:
    """The scene with all optional outputs of the mechanism and every pair of contacts."""
    contacts = scene.contacts and replace(scene.contacts, broad_phase=False)
    mechanism = replace(scene.mechanism, directions=True, diagnostics=True)
    return replace(scene, mechanism=mechanism, contacts=contacts)
