"""The modes of a scene in poses and hands: in each pose it is linearised once, at rest in a firm
spring hand that stands still there, and held by every hand."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from hapticlink.analysis.findings.episodes import FULL_TORQUE
from hapticlink.analysis.findings.tracking import UserSignals
from hapticlink.analysis.search.settings import Scales
from hapticlink.analysis.stability.hand_slopes import hand_slopes
from hapticlink.analysis.stability.hands import FREE, OWN_FREE, UNHELD, free, holds
from hapticlink.analysis.stability.linear_period import LinearPeriod
from hapticlink.analysis.stability.modes import (
    Bounds,
    Mode,
    judged_modes,
    kind,
    leading,
    modes,
    verdict,
)
from hapticlink.analysis.stability.poses import NEAR, Pose, at_pose
from hapticlink.analysis.stability.resting_scene import RestingScene
from hapticlink.analysis.stability.shared_work import SharedWork
from hapticlink.components.device.motors_and_encoders import motor_torques, torque_shares
from hapticlink.components.specs.hand import Hand
from hapticlink.orchestrator.base.errors import FmuFault, InputFault
from hapticlink.orchestrator.base.signal_names import (
    CONTROLLER,
    HAND,
    MEASURED_HANDLE_POSES,
    signal_of_user,
    user_of_block,
)
from hapticlink.orchestrator.scene.blocks import described_devices
from hapticlink.orchestrator.scene.scene import Scene

SHARES = 3
SLIGHT = 0.01
"""Growth rate (1/s) of a marginal case, which takes more than a minute to double."""
NOWHERE = f"divergence within {1e3 * NEAR:g} mm"
"""What a hand is marginal by whose divergence leads nowhere (`Pose.leaves`)."""
TWICE = 2.0
UNSURE = 0.1
"""Uncertainty (1/s) of a growth rate, next to a singular pose, from which on rounding would decide
a limit of stability that is found by it."""
SURELY = 2.0
"""Uncertainties by which such a rate is past what is slight or slow, where it is a limit."""
TIE = 1e-6
"""Difference of growth rates, relative to the larger and SLIGHT at least, up to which they are the
same: which of them rounding makes the larger decides nothing."""
DAMPINGS = 2.0 ** np.arange(-4, 7)
"""Of a free handle (N.s/m), that are tried."""
CALMED = 0.1
"""The smallest decay rate (1/s) that counts as damped enough for a free handle. Where small motions
decay more slowly, large ones around a pose where the constrained directions change can grow."""


@dataclass(frozen=True)
class Case:
    """A hand in a pose: growth rate and its uncertainty (1/s), frequency (Hz) and participation of
    the leading mode, neutral ones aside; verdict: stable, unstable or marginal; kind: what grows,
    or would."""

    pose: str
    hand: str
    growth: float
    uncertainty: float
    hertz: float
    kind: str
    verdict: str
    participation: tuple[tuple[str, float], ...]
    damping: float | None = None
    """Of a free handle that grows: the damping to ground (N.s/m) that ends it; infinite where none
    of DAMPINGS does."""
    neutral: int = 0
    """In how many directions nothing resists, so that equilibria lie side by side."""
    saturated: bool = False
    """Whether motors are at their limit there."""
    at: Pose | None = None
    """The equilibrium."""

    @property
    def free(self) -> bool:
        return self.hand in (FREE, OWN_FREE)

    @property
    def drifts(self) -> bool:
        return self.verdict == "unstable" and self.kind == "drift"

    @property
    def rank(self) -> tuple[bool, ...]:
        """What is worse is larger whatever its growth rate, in the order of the verdicts: what
        grows in a hand, fast rather than drifting; what grows fast in free air; what is marginal in
        a hand."""
        grows = self.verdict == "unstable"
        held = not self.free
        return grows and held, grows and not self.drifts, held, self.verdict == "marginal"

    def record(self) -> dict[str, Any]:
        return {
            "pose": self.pose,
            "hand": self.hand,
            "growth_rate": self.growth,
            "uncertainty": self.uncertainty,
            "frequency": self.hertz,
            "kind": self.kind,
            "verdict": self.verdict,
            "participation": dict(self.participation),
            "damping_needed": self.damping,
            "neutral": self.neutral,
            "saturated": self.saturated,
        }


Item = TypeVar("Item")


def first_of_largest(items: Iterable[Item], growth: Callable[[Item], float]) -> Item:
    """The item with the largest growth rate (1/s), the first one of those that TIE."""
    every = [*items]
    largest = max(map(growth, every))
    least = largest - TIE * max(SLIGHT, abs(largest)) if np.isfinite(largest) else largest
    return next(item for item in every if growth(item) >= least)


def worst_case(cases: Iterable[Case]) -> Case:
    """The worst of some cases; of those that tie the first pose, in its first hand, which are
    sorted from soft to firm."""
    every = [*cases]
    rank = max(case.rank for case in every)
    return first_of_largest((c for c in every if c.rank == rank), lambda case: case.growth)


def hardest_first(cases: Iterable[Case]) -> list[str]:
    """The poses of some cases: that with the most marginal ones first, of those with as many that
    in which a case grows most."""
    poses: dict[str, list[Case]] = {}
    for case in cases:
        poses.setdefault(case.pose, []).append(case)

    def ease(pose: str) -> tuple[int, float]:
        marginal = sum(case.verdict == "marginal" for case in poses[pose])
        return -marginal, -max(case.growth for case in poses[pose])

    return sorted(poses, key=ease)


class InHands:
    """A scene at rest in a pose, with the gains multiplied by `scales` and controllers that compute
    with what they read, behind the holds, `late` of their steps before; for the hand None the
    scene's own stays. Raises InputFault or FmuFault where it has no equilibrium."""

    def __init__(self, place: RestingScene, scales: Scales | None = None, late: int = 0) -> None:
        period = place.period(scales or {})
        names = [f.name for f in place.map.system.fmus]
        for name in names if late else ():
            if user_of_block(name, CONTROLLER) is not None:
                period = period.delayed(name, late)
        self._T, self._seconds, self._space = place.T, place.map.period, place.space
        self._users = [name for name in names if user_of_block(name, HAND) is not None]
        self._period = period.fused(self._users)

    def worst(
        self,
        hands: Mapping[str, Hand | None],
        bounds: Bounds,
        slow: Callable[[Hand | None], float],
    ) -> float:
        """The largest growth rate (1/s) in all hands, or the first one that is positive. Drifts do
        not count, nor what is marginal and grows slightly, or less than TWICE as fast as is `slow`
        in that hand. Raises InputFault where none grows, but rounding decides whether one does."""
        largest, unsure = -np.inf, 0.0
        for hand in hands.values():
            mode, period, _ = self._leading(hand)
            growth, unstable = mode.growth, self._verdict(mode) == "unstable"
            if not unstable and (growth <= SLIGHT or growth <= TWICE * slow(hand)):
                largest = max(largest, min(growth, -SLIGHT))
            elif kind(growth, period.traced(mode).omega / (2 * np.pi), bounds) != "drift":
                if mode.uncertainty < UNSURE * self._seconds:
                    return growth
                least = max(SLIGHT, TWICE * slow(hand))
                apart = np.expm1(least * self._seconds) + SURELY * mode.uncertainty
                if verdict(abs(mode.z), apart) == "unstable":
                    return growth
                unsure = max(unsure, growth)
        if unsure:
            raise InputFault(f"whether a hand grows at {unsure:.2g} 1/s is uncertain")
        return largest

    def slow(self, hand: Hand | None) -> float:
        """The growth rate (1/s) in a hand in which it is marginal, else 0."""
        mode, _, _ = self._leading(hand)
        return mode.growth if self._verdict(mode) == "marginal" else 0.0

    def cases(self, pose: str, hands: Mapping[str, Hand | None], bounds: Bounds) -> list[Case]:
        """The case of each hand."""
        return [self._case(pose, name, hand, bounds) for name, hand in hands.items()]

    def _case(self, pose: str, name: str, hand: Hand | None, bounds: Bounds) -> Case:
        mode, period, neutral = self._leading(hand)
        said = self._verdict(mode)
        mode = period.traced(mode)
        hertz = mode.omega / (2 * np.pi)
        uncertainty = float(min(mode.uncertainty, 1.0)) / self._seconds
        moving = tuple(leading(mode, period.names(), SHARES))
        grows = kind(mode.growth, hertz, bounds)
        case = Case(
            pose, name, mode.growth, uncertainty, hertz, grows, said, moving, neutral=neutral
        )
        if case.free and said == "unstable":
            return replace(case, damping=self._damping())
        return case

    def _leading(self, hand: Hand | None) -> tuple[Mode, LinearPeriod, int]:
        """The mode by which a hand is judged, of which period, and how many are neutral."""
        period = self._period
        if hand is not None:
            period = period.held(
                dict.fromkeys(self._users, hand_slopes(hand, self._T, self._space))
            )
        found = modes(period.linear, self._seconds)
        return judged_modes(found)[0], period, sum(mode.neutral for mode in found)

    def _verdict(self, mode: Mode) -> str:
        slight = np.expm1(SLIGHT * self._seconds)
        return verdict(abs(mode.z), max(mode.uncertainty, slight))

    def _damping(self) -> float:
        """The least damping of a free handle with which it comes to rest."""
        for b in DAMPINGS:
            if self._leading(free(b, self._space))[0].growth < -CALMED:
                return float(b)
        return float(np.inf)


def in_poses(
    read: Scene,
    poses: Sequence[Pose],
    hands: Mapping[str, Hand | None],
    bounds: Bounds,
    begin: Callable[[str], object] = lambda pose: None,
    work: SharedWork | None = None,
) -> tuple[list[Case], dict[str, str]]:
    """The cases in all poses, each of which `begin` is told, and by pose why it has none. A pose in
    which the number of constrained directions depends on what was before is judged with the fewest
    and the most."""
    cases: list[Case] = []
    without: dict[str, str] = {}
    for pose in (left := [*poses]):
        begin(pose.name)
        try:
            with at_pose(read, pose, hands.keys() != {UNHELD}, work=work) as (place, pressed):
                # A constant wrench slides off what it presses on, whatever the loop does.
                lasting = {
                    name: hand
                    for name, hand in hands.items()
                    if hand is None or holds(hand) or not pose.touches
                }
                there = InHands(place).cases(pose.name, lasting, bounds)
                saturated = is_saturated(read, place)
                assert read.linkage is not None
                at = pressed.at_equilibrium(place, read.linkage)
                cases += [replace(case, saturated=saturated, at=at) for case in there]
                left += at.counted_otherwise(place, read.directions)
        except (InputFault, FmuFault) as fault:
            without[pose.name] = str(fault)
    return cases, without


def is_saturated(read: Scene, place: RestingScene) -> bool:
    """Whether motors of a scene at rest are at their limit."""
    for user, device in described_devices(read).items():
        own = UserSignals.of(user)
        poses = (place.signal(signal_of_user(each, user)) for each in MEASURED_HANDLE_POSES)
        F, x = place.signal(own.motors), next((x for x in poses if len(x)), np.zeros(0))
        if len(F) and len(x):
            torques = motor_torques(device, F[None, :], x[None, :])
            if torque_shares(device, torques).max() >= FULL_TORQUE:
                return True
    return False
