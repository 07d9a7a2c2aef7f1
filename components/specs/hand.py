"""[hand]: the user, as a scene writes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hapticlink.components.specs.linkage import Damping, Inertia, Stiffness, Wrench


@dataclass(frozen=True, kw_only=True)
class ConstantHand:
    """A constant wrench (N, N, N.m) at the handle, with an optional damping to ground."""

    type: Literal["constant"] = "constant"
    wrench: Wrench
    damping: Damping | None = None


@dataclass(frozen=True, kw_only=True)
class ProfileHand:
    """A wrench read from a table of rows (t s, N, N, N.m), linear between rows, held after."""

    type: Literal["profile"] = "profile"
    table: tuple[tuple[float, float, float, float], ...]
    damping: Damping | None = None


@dataclass(frozen=True, kw_only=True)
class ArmHand:
    """An arm behind a grip: mass M_a held to a target path by K_a, B_a, and to the handle by
    the grip's K_gr, B_gr. target: rows (t s, x m, y m, theta rad), linear, held after."""

    type: Literal["arm"] = "arm"
    mass: Inertia = (1.0, 1.0, 0.002)
    stiffness: Stiffness = (300.0, 300.0, 1.0)
    damping: Damping = (10.0, 10.0, 0.02)
    grip_stiffness: Stiffness = (2000.0, 2000.0, 5.0)
    grip_damping: Damping = (20.0, 20.0, 0.05)
    target: tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True, kw_only=True)
class SpringHand:
    """A massless hand: spring and damper (N/m, N/m, N.m/rad; N.s/m, ...) to a target path,
    rows (t s, x m, y m, theta rad), linear, held after."""

    type: Literal["spring"] = "spring"
    stiffness: Stiffness
    damping: Damping | None = None
    target: tuple[tuple[float, float, float, float], ...] = ((0.0, 0.0, 0.0, 0.0),)


Hand = ConstantHand | ProfileHand | ArmHand | SpringHand
