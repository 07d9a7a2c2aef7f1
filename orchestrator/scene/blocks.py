"""The blocks that a scene needs: which FMUs are built, with which settings, at which rate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from hapticlink.components.contact.broad_phase import near
from hapticlink.components.port_space import POINT
from hapticlink.components.specs.contacts import ContactsOfAllPairs
from hapticlink.components.specs.device import Device, Handle, NumberOrigins
from hapticlink.components.specs.driver import Driver
from hapticlink.components.specs.linkage import GraphicsCopy
from hapticlink.orchestrator.base.signal_names import (
    CONTROLLER,
    DEVICE,
    ENVIRONMENT,
    HAND,
    MECHANISM,
    MOTOR_MAP,
    OBSERVER,
    block_of_user,
)
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.rates import AnyRate
from hapticlink.orchestrator.scene.scene import Scene


@dataclass(frozen=True)
class BlockPlan:
    """An FMU that is built: `block` is the name in `components.blocks.BLOCKS` of the function that
    builds it; the rate of a block of the haptic loop is "haptics" or "graphics"."""

    name: str
    block: str
    rate: AnyRate
    settings: dict[str, Any]
    engine: str | None = None
    """The physics engine by which it is made, in place of our equations."""
    starts: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Start values of its variables, by name, that are not among the settings."""


@dataclass(frozen=True)
class Blocks:
    """All blocks of a scene, planned once and handed on from the scene to the system."""

    loop: tuple[BlockPlan, ...]
    """Those of the haptic loop in its order, whether an FMU replaces them or not."""
    replaced: Mapping[str, BlockPlan]
    """Those of the loop that an FMU of the scene replaces, by name."""
    own: tuple[BlockPlan, ...]
    """The others of the loop."""
    built: tuple[BlockPlan, ...]
    """All that are built into FMUs of our equations: `own`, then those of [[fmu]] tables."""
    engines: tuple[BlockPlan, ...]
    """Those of the loop that are built into FMUs of a physics engine."""
    rates: Mapping[str, AnyRate]
    """The rate of each FMU: of the loop's blocks, then of [[fmu]] tables."""


def blocks(scene: Scene, *, skip: bool = True) -> Blocks:
    """The blocks of `scene`; skip=False includes what nothing in it uses."""
    loop = tuple(_loop(scene, skip))
    replacing = {f.replaces for f in scene.fmu}
    replaced = {b.name: b for b in loop if b.name in replacing}
    own = tuple(b for b in loop if b.name not in replaced)
    rates = {b.name: b.rate for b in own}
    for f in scene.fmu:
        rates[f.name] = f.rate or (replaced[f.name].rate if f.name in replaced else "haptics")
    tables = (
        BlockPlan(f.name, f.block, rates[f.name], dict(f.settings)) for f in scene.fmu if f.block
    )
    engines = tuple(
        replace(replaced[f.name], rate=rates[f.name], engine=f.engine)
        for f in scene.fmu
        if f.engine and f.name in replaced
    )
    return Blocks(loop, replaced, own, (*own, *tables), engines, rates)


@dataclass(frozen=True)
class FromGraphics:
    """What the virtual environment computes for other blocks."""

    mobility: bool
    directions: bool
    """P_c: for the controller, or as an output that the scene requests beside the mobility."""
    contacts: bool
    """The geometry of the pairs that can touch."""
    local_model: bool

    @property
    def names(self) -> list[str]:
        """What it computes, in words; empty where the block is not needed."""
        words = ("Lambda_inv", "P_c", "contact geometry", "the local model")
        wanted = (self.mobility, self.directions, self.contacts, self.local_model)
        return [word for word, is_wanted in zip(words, wanted, strict=True) if is_wanted]


def from_graphics(scene: Scene) -> FromGraphics:
    held = scene.directions_from == "graphics"
    directions = topology(scene) or (impedance(scene) and scene.mechanism.directions)
    linkage, contacts = scene.linkage, scene.contacts
    geometry = linkage and contacts and contacts.detection == "graphics"
    return FromGraphics(
        mobility=held and impedance(scene),
        directions=held and directions,
        contacts=bool(geometry and near(linkage, contacts)),  # type: ignore[arg-type]
        local_model=scene.local_model,
    )


def _loop(scene: Scene, skip: bool) -> Iterator[BlockPlan]:
    """The blocks of the haptic loop in its order."""
    if not skip:
        scene = _with_all_outputs(scene)
    yield from _blocks_of_users(scene)
    if not scene.linkage:
        return
    yield BlockPlan(MECHANISM, MECHANISM, scene.mechanism_at, _mechanism(scene))
    if scene.graphics:
        wanted = from_graphics(scene)
        if not skip:
            wanted = replace(wanted, mobility=True, directions=True)
        if wanted.names:
            yield BlockPlan(ENVIRONMENT, ENVIRONMENT, "graphics", _environment(scene, wanted))


def _blocks_of_users(scene: Scene) -> Iterator[BlockPlan]:
    clutch, partial = bool(scene.linkage and scene.linkage.choices), partial_handles(scene)
    for user, hand in scene.all_hands.items():
        if driver_of(scene, user):  # somebody's own hand holds the board
            continue
        settings: dict[str, Any] = {"hand": hand}
        if clutch and not user:
            settings["clutch"] = True
        if user in partial:
            settings["handle"] = partial[user]
        if scene.space == POINT:
            settings["space"] = "point"
        yield BlockPlan(block_of_user(HAND, user), HAND, "haptics", settings)
    devices = {
        user: replace(d, driver=None, origin=NumberOrigins())
        for user, d in scene.all_devices.items()
    }
    beside = {user: devices[user] for user in observed_beside(scene)}
    for user, device in beside.items():
        yield BlockPlan(block_of_user(OBSERVER, user), OBSERVER, "haptics", {"device": device})
    for user, controller in scene.all_controllers.items():
        settings = {
            "controller": replace(controller, contact=True) if others(scene) else controller,
            "directions": scene.directions,
            "linkage": scene.linkage,
        }
        if clutch and not user:
            settings["clutch"] = True
        if user in partial:
            settings["handle"] = partial[user]
        yield BlockPlan(block_of_user(CONTROLLER, user), CONTROLLER, "haptics", settings)
    for user, device in beside.items():
        yield BlockPlan(block_of_user(MOTOR_MAP, user), MOTOR_MAP, "haptics", {"device": device})
    for user, device in devices.items():
        settings = {"device": device}
        if scene.sensing == "encoders":
            settings["encoders"] = True
        yield BlockPlan(block_of_user(DEVICE, user), DEVICE, "haptics", settings)


def _mechanism(scene: Scene) -> dict[str, Any]:
    """The settings of the virtual mechanism, without those that only repeat a default."""
    assert scene.linkage is not None
    settings: dict[str, Any] = {"linkage": scene.linkage, "mechanism": scene.mechanism}
    felt = others(scene) and bool(scene.all_controllers)
    if scene.directions_from == "mechanism" or scene.mechanism.directions:
        settings["directions"] = scene.directions
        if handles := partial_handles(scene):
            settings["handles"] = handles
    if scene.contacts:
        settings["contacts"] = scene.contacts
    if scene.controller and felt:
        settings["felt"] = True
    if scene.devices:
        settings["users"] = tuple(scene.devices)
    if scene.contacts or scene.linkage.limited or felt:
        settings["length_scale"] = scene.directions.length_scale
    if scene.local_model:
        settings["local_model"] = True
    if scene.linkage.choices:
        settings["coupled"] = bool(scene.device)
        settings["followed"] = bool(scene.graphics and from_graphics(scene).names)
    return settings


def _environment(scene: Scene, wanted: FromGraphics) -> dict[str, Any]:
    """The settings of the virtual environment."""
    copied = {f.name: getattr(scene.graphics, f.name) for f in fields(GraphicsCopy)}
    settings: dict[str, Any] = {
        "linkage": scene.linkage,
        "graphics": GraphicsCopy(**copied),
        "directions": scene.directions if wanted.directions else None,
        "contacts": scene.contacts if wanted.contacts else None,
        "mobility": wanted.mobility,
        "local_model": wanted.local_model,
    }
    if wanted.directions and (handles := partial_handles(scene)):
        settings["handles"] = handles
    if holds_model(scene) and copied["sync"] != "operational":
        settings["predicted"] = True
    return settings | ({"users": tuple(scene.devices)} if scene.devices else {})


def partial_handles(scene: Scene) -> dict[str, Handle]:
    """The handles of devices that do not render all directions, by user."""
    handles = {user: device.handle for user, device in scene.all_devices.items()}
    return {user: handle for user, handle in handles.items() if handle.angle != "held"}


def holds_model(scene: Scene) -> bool:
    """Whether a hold is asked for that needs gradients of what the graphics copy puts out."""
    asked = {scene.hold, *scene.named_holds.values()}
    return any(HOLDS[name].needs == "gradient" for name in asked if name in HOLDS)


def impedance(scene: Scene) -> bool:
    return any(controller.impedance for controller in scene.all_controllers.values())


def topology(scene: Scene) -> bool:
    return any(controller.topology is not False for controller in scene.all_controllers.values())


def described_devices(scene: Scene) -> dict[str, Device]:
    """The devices that are as [device] says, by user: not those in whose place an FMU from
    elsewhere is, except where the observer beside it goes by [device]."""
    replaced = {fmu.replaces for fmu in scene.fmu}
    return {
        user: device
        for user, device in scene.all_devices.items()
        if device.observer.beside or block_of_user(DEVICE, user) not in replaced
    }


def observed_beside(scene: Scene) -> list[str]:
    """The users whose device has its observer beside it."""
    sensed = scene.all_devices if scene.sensing == "encoders" else {}
    return [user for user, device in sensed.items() if device.observer.beside]


def driver_of(scene: Scene, user: str) -> Driver | None:
    """The board in the place of a user's device, None where that is simulated."""
    device = scene.all_devices.get(user)
    driver = device.driver if device else None
    return driver if driver and driver.active else None


def others(scene: Scene) -> bool:
    """Whether others than the hand act on the mechanism: hands at further points, or efforts on its
    joints."""
    linkage = scene.linkage
    return bool(linkage and (linkage.point or any("effort" in j.ports for j in linkage.joint)))


def _with_all_outputs(scene: Scene) -> Scene:
    """The scene with all optional outputs of the mechanism and every pair of contacts."""
    contacts = scene.contacts and ContactsOfAllPairs(**vars(scene.contacts))
    mechanism = replace(scene.mechanism, directions=True, diagnostics=True)
    return replace(scene, mechanism=mechanism, contacts=contacts)
