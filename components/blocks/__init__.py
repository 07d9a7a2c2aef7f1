"""The blocks, one FMU a file; `BLOCKS` holds them by the names that a scene uses.

A block is a function that returns a component. Its arguments are its settings, whose names and
annotations define the keys of a scene; step sizes are none of them, but parameters (component.py).
The functions here import their equations when they are called, so that reading a scene does not.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal

from hapticlink.components.registry import Registry, no_function
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.control import Controller
from hapticlink.components.specs.device import Device, Handle
from hapticlink.components.specs.hand import Hand
from hapticlink.components.specs.linkage import Directions, GraphicsCopy, Linkage, Mechanism
from hapticlink.components.specs.paths import Interpolation
from hapticlink.components.specs.quantities import (
    LinearDamping,
    LinearStiffness,
    Position,
    Quantity,
)

if TYPE_CHECKING:
    from hapticlink.components.component import Component

FRAME = 1 / 30
"""Where `frame_size` (s) starts, which a run sets."""


def _virtual_mechanism(
    linkage: Linkage,
    mechanism: Mechanism,
    directions: Directions | None = None,
    contacts: Contacts | None = None,
    length_scale: float | None = None,
    local_model: bool = False,
    felt: bool = False,
    users: tuple[str, ...] = (),
    coupled: bool = False,
    followed: bool = False,
    handles: Mapping[str, Handle] = MappingProxyType({}),
) -> Component:
    from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism

    return virtual_mechanism(
        linkage, mechanism, directions, contacts, length_scale=length_scale,
        frame_s=FRAME if local_model else None, felt=felt, users=users, coupled=coupled,
        followed=followed, handles=handles,
    )  # fmt: skip


def _virtual_environment(
    linkage: Linkage,
    graphics: GraphicsCopy,
    directions: Directions | None = None,
    contacts: Contacts | None = None,
    mobility: bool = True,
    local_model: bool = False,
    users: tuple[str, ...] = (),
    predicted: bool = False,
    handles: Mapping[str, Handle] = MappingProxyType({}),
) -> Component:
    from hapticlink.components.blocks.virtual_environment import virtual_environment

    return virtual_environment(
        linkage, graphics, directions, contacts, mobility=mobility, local_model=local_model,
        frame_s=FRAME, users=users, predicted=predicted, handles=handles,
    )  # fmt: skip


def _haptic_device(device: Device, encoders: bool = False) -> Component:
    from hapticlink.components.blocks.haptic_device import haptic_device

    return haptic_device(device, encoders)


def _observer(device: Device) -> Component:
    from hapticlink.components.blocks.observer import observer

    return observer(device)


def _motor_map(device: Device) -> Component:
    from hapticlink.components.blocks.motor_map import motor_map

    return motor_map(device)


def _controller(
    controller: Controller,
    linkage: Linkage,
    directions: Directions,
    clutch: bool = False,
    handle: Handle | None = None,
) -> Component:
    from hapticlink.components.blocks import controller as block
    from hapticlink.components.linkage.parameters import mean_link_length

    given = directions.length_scale
    length = mean_link_length(linkage) if given is None else given
    return block.controller(controller, linkage.space, length, clutch=clutch, handle=handle)


def _hand(
    hand: Hand,
    clutch: bool = False,
    space: Literal["plane", "point"] = "plane",
    handle: Handle | None = None,
) -> Component:
    from hapticlink.components.blocks import hand as block
    from hapticlink.components.port_space import PLANE, POINT

    port = PLANE if space == "plane" else POINT
    return block.hand(hand, port, clutch=clutch, handle=handle)


def _discrete_equivalent(rule: str) -> Component:
    from hapticlink.components.blocks.discrete_equivalent import discrete_equivalent

    return discrete_equivalent(rule)


def _virtual_wall(
    stiffness: LinearStiffness,
    damping: LinearDamping | None = None,
    position: Position = 0.0,
    quantum: Annotated[float, Quantity("m", ge=0)] | None = None,
    unilateral: bool = True,
    velocity: Literal["difference", "measured"] = "difference",
    pulse: Annotated[float, Quantity("kg", ge=0)] | None = None,
    pulse_duration: Annotated[float, Quantity("s", ge=0)] = 0.01,
    passivity: Annotated[float, Quantity("kg", gt=0)] | None = None,
) -> Component:
    from hapticlink.components.blocks.virtual_wall import virtual_wall

    return virtual_wall(
        stiffness,
        damping,
        position=position,
        quantum=quantum,
        unilateral=unilateral,
        measured_velocity=velocity == "measured",
        pulse=None if pulse is None else (pulse, pulse_duration),
        passivity=passivity,
    )


def _signal(
    table: tuple[tuple[Annotated[float, Quantity("that of its column")], ...], ...] | None = None,
    interpolation: Interpolation = "linear",
    formula: str | tuple[str, ...] | None = None,
    units: tuple[str, ...] = (),
) -> Component:
    from hapticlink.components.blocks.signal import signal

    return signal(table, interpolation, formula, units)


def _misfit(part: Any) -> str:
    """Why a part is no block, "" if it is one."""
    if why := no_function(part):
        return why
    for a in inspect.signature(part).parameters.values():
        if a.kind not in (a.POSITIONAL_OR_KEYWORD, a.KEYWORD_ONLY) or a.annotation is a.empty:
            return f"has an argument {a}: a setting has a name and an annotation"
    return ""


BLOCKS: Registry[Callable[..., Component]] = Registry(
    "block",
    {
        "virtual_mechanism": _virtual_mechanism,
        "virtual_environment": _virtual_environment,
        "haptic_device": _haptic_device,
        "observer": _observer,
        "motor_map": _motor_map,
        "controller": _controller,
        "hand": _hand,
        "discrete_equivalent": _discrete_equivalent,
        "virtual_wall": _virtual_wall,
        "signal": _signal,
    },
    _misfit,
)
