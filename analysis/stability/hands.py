"""The hands in which a scene is judged, from soft to firm.

The form is that of Speich, Shao, Goldfarb (Mechatronics 15 (2005), 1127): a mass on spring and
damper behind the spring and damper of a grip; a massless grip alone is the limit that moves with
the handle. Which numbers are computed from published ones, and which are a choice within or beyond
a published range, docs/equilibrium.md says one by one. Rotational values are assumed: LEVER times
those of translation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace

from hapticlink.components.specs.hand import (
    ArmHand,
    ConstantHand,
    Hand,
    HoldingHand,
    ProfileHand,
    SpringHand,
)
from hapticlink.orchestrator.base.arrays import Vector

SPRINGS = (100.0, 1000.0)
"""Stiffnesses (N/m): a light touch and a firm grip."""
FIRM = SPRINGS[-1]
LEVER = 1 / 300
"""Rotational stiffness (N.m/rad) over that of translations (N/m)."""
DAMPING = (5.0, 5.0, 0.01)
"""(N.s/m, N.m.s/rad)."""
STILL = ((0.0, 0.0, 0.0, 0.0),)
OWN = "the scene's own hand"
FREE = "free"
OWN_FREE = "the scene's own damper"
UNHELD = "as it is"
"""Of a scene that no hand of the package holds."""


def spring_hand(stiffness: float) -> SpringHand:
    """A massless hand of a stiffness (N/m)."""
    stiff = (stiffness, stiffness, stiffness * LEVER)
    return SpringHand(stiffness=stiff, damping=DAMPING, target=STILL)


def arm(mass: float, stiffness: float, damping: float, grip: float, grip_damping: float) -> ArmHand:
    """An arm (kg, N/m, N.s/m) behind a grip (N/m, N.s/m)."""

    def turned(value: float) -> tuple[float, float, float]:
        return value, value, value * LEVER

    return ArmHand(
        mass=(mass, mass, mass * 0.002),
        stiffness=turned(stiffness),
        damping=turned(damping),
        grip_stiffness=turned(grip),
        grip_damping=turned(grip_damping),
        target=STILL,
    )


HANDS: dict[str, Hand] = {
    "light touch": spring_hand(SPRINGS[0]),
    "firm grip": spring_hand(FIRM),
    "arm at rest, soft grip": arm(2.0, 10.0, 2.0, 300.0, 5.0),
    "arm at rest, firm grip": arm(2.0, 10.0, 2.0, 2000.0, 20.0),
    "arm in posture, firm grip": arm(1.0, 300.0, 10.0, 2000.0, 20.0),
    "stiff arm, firm grip": arm(1.5, 1000.0, 30.0, 4000.0, 30.0),
}
"""By name."""


def free(damping: float = 0.0, turning: float = 0.0) -> ConstantHand:
    """No hand but a damper to ground (N.s/m, N.m.s/rad)."""
    return ConstantHand(wrench=(0.0, 0.0, 0.0), damping=(damping, damping, turning))


def linearise_hand(hand: Hand) -> Hand:
    """A hand of a scene with what its linearisation needs: it stands still, sampled."""
    if isinstance(hand, ConstantHand | ProfileHand):
        return ConstantHand(wrench=(0.0, 0.0, 0.0), damping=hand.damping)
    return replace(hand, target=STILL, timing="sampled")


def holds(hand: Hand) -> bool:
    """Whether a hand has a stiffness."""
    return isinstance(hand, HoldingHand)


def standing(hand: HoldingHand, pose: Sequence[float] | Vector) -> dict[str, object]:
    """The [hand] table of a hand that stands still at a pose (m, m, rad)."""
    table = {k: v for k, v in asdict(hand).items() if v is not None and k != "interpolation"}
    return table | {"target": [[0.0, *map(float, pose)]]}


def spring(pose: Sequence[float], wrench: Sequence[float], stiffness: float) -> dict[str, object]:
    """The [hand] table of a spring that presses with `wrench` on a handle at `pose`."""
    hand = spring_hand(stiffness)
    return standing(hand, [x + F / k for x, F, k in zip(pose, wrench, hand.stiffness, strict=True)])
