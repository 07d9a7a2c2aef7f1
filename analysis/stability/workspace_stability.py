"""The stability of a scene over its workspace and in hands: the one answer of `stability`.

The linearised sampled-data map is judged in poses that the scene's own run visits within SPAN,
held by a family of hands, the scene's own among them, and free where that has no stiffness; it
depends on neither the duration of the scene nor on an equilibrium that a search finds.
A constant wrench is judged where it would come to rest, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.analysis.stability.hands import FREE, HANDS, OWN, OWN_FREE, holds, own_hand
from hapticlink.analysis.stability.improvements import improvements
from hapticlink.analysis.stability.linearisable_scene import linearisable
from hapticlink.analysis.stability.mode_kinds import DRIFT, Bounds
from hapticlink.analysis.stability.poses import Pose, average, evenly_spaced, simulated
from hapticlink.analysis.stability.varying_rate import varies
from hapticlink.analysis.stability.workspace_cases import in_poses
from hapticlink.analysis.stability.workspace_verdict import WorkspaceStability
from hapticlink.components.specs.hand import ConstantHand, Hand
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.base.loop_names import HAND
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene

POSES, SPAN = 3, 3.0
"""Poses, evenly spaced in the first seconds of the scene's run."""
SETTLING, CALM = 10.0, 0.2
"""Time (s) in which a constant wrench takes a damped handle near rest, and its last part, over
which the pose is averaged."""
SETTLED_BY = (5.0, 5.0, 0.005)
"""Damping of the handle meanwhile (N.s/m, N.m.s/rad)."""
Tell = Callable[[str, int, int], object]


def stability(
    scene: str | Path | Scene,
    options: Options = (),
    *,
    poses: int = POSES,
    bounds: Bounds = DRIFT,
    tell: Tell | None = None,
) -> WorkspaceStability:
    """The stability of a scene, changed by `options` (see `scene`), in a number of `poses` of its
    run and in hands from soft to firm.

    `tell` is called with what is judged, and the numbers of finished and of all steps. `bounds` are
    those of a drift. Raises InputFault for a scene without linkage or hand, one whose run or map
    has no period (rates and latencies that vary), and one without equilibrium in any pose.
    """
    if poses < 1:
        raise InputFault(f"poses = {poses}: give 1 or more")
    if not (bounds.hertz >= 0.0 and bounds.growth >= 0.0):
        raise InputFault(
            f"drift up to {bounds.hertz:g} Hz and {bounds.growth:g} 1/s: give 0 or more"
        )
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"):
        given = overrides.written(options)
        return _Judgement(scene, given, bounds, tell or _silent).made(poses)


def _silent(what: str, done: int, of: int) -> None:
    """Tells nobody."""


def hands_of(hand: Hand) -> dict[str, Hand]:
    """The family, with the hand of a scene, and no hand where that has no stiffness."""
    if holds(hand):
        return {OWN: own_hand(hand), **HANDS}
    damped = any(getattr(hand, "damping", None) or ())
    return {**HANDS, (OWN_FREE if damped else FREE): own_hand(hand)}


class _Judgement:
    def __init__(
        self, scene: str | Path | Scene, given: tuple[str, ...], bounds: Bounds, tell: Tell
    ) -> None:
        self._scene, self._given, self._bounds, self._tell = scene, given, bounds, tell
        self._read = read = open_scene.load(scene, given)
        if read.linkage is None or read.hand is None or any(f.replaces == HAND for f in read.fmu):
            raise InputFault(
                "no hand of the package holds a linkage, so that no other hand can be put in its "
                "place: ask for the equilibrium of the scene (--equilibrium)"
            )
        if varies(read):
            raise InputFault(
                "a rate that varies is judged in mean square, at the equilibrium of the scene: "
                "--equilibrium, with a hand that holds it"
            )
        self._hands = hands_of(read.hand)

    def made(self, count: int) -> WorkspaceStability:
        linkage = self._read.linkage
        assert linkage is not None
        self._tell("the scene's own run", 0, count + 2)
        run = simulated(self._scene, (*self._given, f"duration={SPAN}", 'stop_when=""'))
        visited = evenly_spaced(run, linkage, count)
        visited += self._at_wrench()

        def tell(done: int, of: int) -> None:
            self._tell("poses", done + 1, of + 2)

        found, without = in_poses(
            self._scene, self._given, visited, self._hands, self._bounds, tell
        )
        if not found:
            name, why = next(iter(without.items()))
            raise InputFault(f"no equilibrium in any pose, at {name}: {why}")
        worst = max(found, key=lambda case: case.severity)
        pose = next(p for p in visited if p.name == worst.pose)
        self._tell("margins", len(visited) + 1, len(visited) + 2)
        margin, remedy = improvements(
            self._scene,
            self._given,
            visited,
            pose,
            self._hands,
            self._bounds,
            worst,
            {case.pose for case in found},
        )
        return WorkspaceStability(
            title=self._read.title,
            bounds=self._bounds,
            poses=tuple(visited),
            hands=self._hands,
            cases=tuple(found),
            without=without,
            worst=worst,
            margin=margin,
            remedy=remedy,
            frozen=self._frozen,
        )

    def _at_wrench(self) -> list[Pose]:
        """Where a constant wrench would come to rest, if it does, with a damped handle: at the end
        of a run, or about its mean if there is no equilibrium nearby."""
        hand, linkage = self._read.hand, self._read.linkage
        if not isinstance(hand, ConstantHand) or not any(hand.wrench) or linkage is None:
            return []
        settled: dict[str, float | list[float]] = {
            "hand.damping": list(SETTLED_BY),
            "duration": SETTLING,
        }
        try:
            run = simulated(self._scene, self._given, settled)
        except InputFault:
            return []
        if run.record.fault:
            return []
        near = (average(run, linkage, since) for since in (1.0, 1.0 - CALM))
        return [replace(p, press=hand.wrench, title="where its wrench leads") for p in near]

    @property
    def _frozen(self) -> tuple[str, ...]:
        with linearisable(self._scene, self._given) as (_, system, removed):
            return (*removed, *frozen_nonlinearities.kept(system))
