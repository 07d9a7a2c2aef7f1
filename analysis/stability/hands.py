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

from hapticlink.components.port_space import PLANE, PortSpace
from hapticlink.components.specs.hand import (
    ArmHand,
    ConstantHand,
    Hand,
    HoldingHand,
    ProfileHand,
    SpringHand,
)
from hapticlink.orchestrator.base.arrays import Vector

Three = tuple[float, float, float]
SPRINGS = (100.0, 1000.0)
"""Stiffnesses (N/m): a light touch and a firm grip."""
FIRM = SPRINGS[-1]
LEVER = 1 / 300
"""Rotational stiffness (N.m/rad) over that of translations (N/m)."""
DAMPING = 5.0
"""Of these (N.s/m)."""
GYRATION = 0.002
"""Moment of inertia (kg.m2) over mass (kg), and a spring's damping likewise."""
TURNING = 1e-3
"""Rotational damping (N.m.s/rad) of a free handle over that of translations (N.s/m)."""
STILL = ((0.0, 0.0, 0.0, 0.0),)
OWN = "the scene's own hand"
FREE = "free"
OWN_FREE = "the scene's own damper"
UNHELD = "as it is"
"""Of a scene that no hand of the package holds."""


def by_direction(space: PortSpace, value: float, lever: float) -> Three:
    """A value along lengths, and `lever` times it about axes."""
    x, y, z = (value * lever if turns else value for turns in space.turns)
    return x, y, z


def spring_hand(stiffness: float, space: PortSpace = PLANE) -> SpringHand:
    """A massless hand of a stiffness (N/m)."""
    return SpringHand(
        stiffness=by_direction(space, stiffness, LEVER),
        damping=by_direction(space, DAMPING, GYRATION),
        target=STILL,
    )


ARMS = {
    "arm at rest, soft grip": (2.0, 10.0, 2.0, 300.0, 5.0),
    "arm at rest, firm grip": (2.0, 10.0, 2.0, 2000.0, 20.0),
    "arm in posture, firm grip": (1.0, 300.0, 10.0, 2000.0, 20.0),
    "stiff arm, firm grip": (1.5, 1000.0, 30.0, 4000.0, 30.0),
}
"""Of arms mass (kg), stiffness (N/m) and damping (N.s/m), and these two of their grips."""


def hands_in(space: PortSpace) -> dict[str, Hand]:
    """The hands at a port, by name."""
    hands: dict[str, Hand] = {
        "light touch": spring_hand(SPRINGS[0], space),
        "firm grip": spring_hand(FIRM, space),
    }
    for name, (mass, *gains) in ARMS.items():
        k, b, grip, damped = (by_direction(space, value, LEVER) for value in gains)
        hands[name] = ArmHand(
            mass=by_direction(space, mass, GYRATION),
            stiffness=k, damping=b, grip_stiffness=grip, grip_damping=damped, target=STILL,
        )  # fmt: skip
    return hands


HANDS = hands_in(PLANE)


def free(damping: float = 0.0, space: PortSpace = PLANE) -> ConstantHand:
    """No hand but a damper to ground (N.s/m)."""
    return ConstantHand(wrench=(0.0, 0.0, 0.0), damping=by_direction(space, damping, TURNING))


def linearise_hand(hand: Hand) -> Hand:
    """A hand of a scene with what its linearisation needs: it stands still, sampled."""
    if isinstance(hand, ConstantHand | ProfileHand):
        return ConstantHand(wrench=(0.0, 0.0, 0.0), damping=hand.damping)
    return replace(hand, target=STILL, timing="sampled")


def holds(hand: Hand) -> bool:
    """Whether a hand has a stiffness."""
    return isinstance(hand, HoldingHand)


def standing(hand: HoldingHand, pose: Sequence[float] | Vector) -> dict[str, object]:
    """The [hand] table of a hand that stands still at a pose."""
    table = {k: v for k, v in asdict(hand).items() if v is not None and k != "interpolation"}
    return table | {"target": [[0.0, *map(float, pose)]]}


def spring(
    pose: Sequence[float], wrench: Sequence[float], stiffness: float, space: PortSpace = PLANE
) -> dict[str, object]:
    """The [hand] table of a spring that presses with `wrench` on a handle at `pose`."""
    hand = spring_hand(stiffness, space)
    return standing(hand, [x + F / k for x, F, k in zip(pose, wrench, hand.stiffness, strict=True)])
