"""The stability of a scene over its workspace and in hands: the one answer of `stability`.

The linearised sampled-data map is judged in poses that the scene's own run visits within SPAN,
held by a family of hands, the scene's own among them, and free where that has no stiffness; it
depends on neither the duration of the scene nor on an equilibrium that a search finds.
A constant wrench is judged where it would come to rest, too. What no hand of the package holds is
judged as it is, where its run comes to rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

from hapticlink.analysis.search.acceptance import broken_limit
from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.analysis.stability.hand_cases import NOWHERE, hardest_first, in_poses, worst_case
from hapticlink.analysis.stability.hands import (
    FREE,
    OWN,
    OWN_FREE,
    UNHELD,
    hands_in,
    holds,
    linearise_hand,
)
from hapticlink.analysis.stability.margin_and_remedy import MARGINS, improvements
from hapticlink.analysis.stability.modes import DRIFT, Bounds
from hapticlink.analysis.stability.poses import (
    Pose,
    choose_evenly_spaced,
    fault_of,
    find_rest_pose,
    is_hand_replaced,
    presses,
    rest,
    simulate_for,
)
from hapticlink.analysis.stability.remedy_trial import Visited
from hapticlink.analysis.stability.shared_work import SharedWork
from hapticlink.analysis.stability.short_hyperperiod import short
from hapticlink.analysis.stability.smooth_scene import linearisable, with_quicker_fmus
from hapticlink.analysis.stability.stand_in import find_stand_ins
from hapticlink.analysis.stability.told_steps import Progress, Steps
from hapticlink.analysis.stability.varying_rate import VaryingStability, varies, varying_stability
from hapticlink.analysis.stability.verdict_record import Stability
from hapticlink.analysis.stability.workspace_grid import grid_poses
from hapticlink.components.port_space import PLANE, PortSpace
from hapticlink.components.specs.hand import Hand
from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.base.errors import InputFault, shorten
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.scene.arguments import require
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.fmu_files import prefer_compiled

POSES, SPAN = 3, 3.0
"""Poses, evenly spaced in the first seconds of the scene's run."""
GRID = 32
"""Most places along each side of a grid."""
Hands = Mapping[str, Hand | None]


@one_blas_thread()
def stability(
    scene: str | Path | Scene,
    options: Options = (),
    *,
    poses: int = POSES,
    grid: int = 0,
    bounds: Bounds = DRIFT,
    progress: Progress | None = None,
) -> Stability:
    """The stability of a scene, changed by `options` (see `scene`), in a number of `poses` of its
    run and in hands from soft to firm. With `grid` = N it is also judged with the operational point
    at N x N places around those that the run visits, as far as linkage and device reach them.

    `progress` is called with what is judged, and the numbers of finished and of all steps. `bounds`
    are those of a drift. Raises InputFault for a scene without linkage, one whose run or map has no
    period (rates and latencies that vary), and one without equilibrium in any pose.
    """
    poses = int(require("poses", poses, Annotated[int, Quantity("1", ge=1)]))
    grid = int(require("grid", grid, Annotated[int, Quantity("1", ge=0, le=GRID)]))
    _require_bounds(bounds)
    read = open_scene.load(scene, options)
    if varies(read):
        raise InputFault(
            "a rate that varies is judged in mean square, at the equilibrium of the scene: "
            "--equilibrium, with a hand that holds it"
        )
    if read.hand is None or is_hand_replaced(read):
        return _judge_at_rest(read, bounds, progress)
    if read.linkage is None:
        raise InputFault("no linkage: nothing that a hand could hold")
    if grid and read.linkage.dimension > 2:
        raise InputFault("places on a grid are of the plane: leave out --grid of a scene in space")
    hands = hands_of(read.hand, read.space)
    read = with_quicker_fmus(read)
    with interrupt.defer_signals(), process_cache.keep_unpacked(), prefer_compiled():
        steps = Steps(progress, 1)
        steps.begin("the scene's own run")
        own, own_run = _visit_poses(short(read)[0], poses, grid)
        own_fault = fault_of(own_run)

        def visits(changed: Scene) -> tuple[list[Pose], str]:
            if changed is read:
                return own, ""
            found, run = _visit_poses(changed, poses, grid)
            if (fault := fault_of(run)) and not own_fault:
                raise InputFault(fault)
            return found, broken_limit(changed, run)

        work = SharedWork(run=lambda: own_run)
        judged = _judge(read, visits, hands, bounds, steps, work)
    return replace(judged, run_fault=own_fault)


@one_blas_thread()
def equilibrium_stability(
    scene: str | Path | Scene,
    options: Options = (),
    *,
    bounds: Bounds = DRIFT,
    progress: Progress | None = None,
) -> Stability | VaryingStability:
    """The stability of a scene in its own hand alone, where its run comes to rest within a minute;
    for a rate that is drawn at random that of all its periods, next to the scene's start.

    `bounds` and `progress` as in `stability`. Raises InputFault as that does, and where the run
    keeps moving.
    """
    _require_bounds(bounds)
    read = open_scene.load(scene, options)
    if varies(read):
        with interrupt.defer_signals(), np.errstate(invalid="ignore", over="ignore"):
            return varying_stability(read)
    return _judge_at_rest(read, bounds, progress)


def _require_bounds(bounds: Bounds) -> None:
    if not isinstance(bounds, Bounds):
        raise InputFault(f"bounds = {shorten(repr(bounds))}: give Bounds(hertz, growth)")
    if not (bounds.hertz >= 0.0 and bounds.growth >= 0.0):
        raise InputFault(
            f"drift up to {bounds.hertz:g} Hz and {bounds.growth:g} 1/s: give 0 or more"
        )


def hands_of(hand: Hand, space: PortSpace = PLANE) -> dict[str, Hand]:
    """The family at a port, with the hand of a scene, and no hand where that has no stiffness."""
    family = hands_in(space)
    if holds(hand):
        return {OWN: linearise_hand(hand), **family}
    damped = any(getattr(hand, "damping", None) or ())
    return {**family, (OWN_FREE if damped else FREE): linearise_hand(hand)}


def _visit_poses(read: Scene, count: int, grid: int) -> tuple[list[Pose], Results]:
    """The poses that a scene's own run visits, and that run."""
    assert read.linkage is not None
    run = simulate_for(SPAN, read)
    poses = choose_evenly_spaced(run, read.linkage, count)
    if presses(read):
        with suppress(InputFault):
            poses.append(find_rest_pose(read, read.linkage))
    if grid:
        poses += grid_poses(run, read, read.linkage, grid)
    return [*{pose.name: pose for pose in poses}.values()], run


def _judge_at_rest(read: Scene, bounds: Bounds, progress: Progress | None) -> Stability:
    """The verdict where the run comes to rest, in the scene's own hand alone or as it is."""
    hands: Hands = {UNHELD: None}
    if read.hand is not None and not is_hand_replaced(read):
        hands = {OWN: linearise_hand(read.hand)}
    read = with_quicker_fmus(read)
    steps = Steps(progress, 1)
    steps.begin("the run until it rests")
    try:
        work = SharedWork(run=lambda: simulate_for(SPAN, short(read)[0]))
        return _judge(read, _at_rest, hands, bounds, steps, work)
    except InputFault as fault:
        if read.hand or read.device or read.controller or read.fmu:
            raise
        raise InputFault(
            f"{fault}; the scene is a mechanism alone, without a sampled loop to be judged, which "
            "takes a [device] and a [controller], or an [[fmu]] such as a virtual wall"
        ) from None


def _at_rest(read: Scene) -> tuple[list[Pose], str]:
    """Where the run of a scene comes to rest."""
    if read.linkage is None:
        raise InputFault("no linkage: nothing that comes to rest in a pose")
    with interrupt.defer_signals():
        return [rest(short(read)[0], read.linkage)], ""


def _judge(
    read: Scene,
    visits: Visited,
    hands: Hands,
    bounds: Bounds,
    steps: Steps,
    work: SharedWork,
) -> Stability:
    """The verdict in the poses of `visits`, which are found again for a remedy."""
    visited, _ = visits(read)
    short_read, rounded = short(read)
    named = {pose.name: pose for pose in visited}
    steps.expected += len(visited) + len(MARGINS)
    with interrupt.defer_signals(), np.errstate(invalid="ignore", over="ignore"):

        def begin(pose: str) -> None:
            steps.expected += pose not in named
            steps.begin(f"pose at {pose}")

        cases, without = in_poses(short_read, visited, hands, bounds, begin, work)
        if not cases:
            name, why = next(iter(without.items()))
            raise InputFault(f"no equilibrium is found in any pose, at {name}: {why}")
        named |= {case.pose: case.at for case in cases if case.at and case.at.counted}
        for i, case in enumerate(cases):
            diverges = case.kind == "divergence" and case.verdict == "unstable" and not case.free
            if diverges and not named[case.pose].leaves(short_read, hands[case.hand]):
                cases[i] = replace(case, verdict="marginal", kind=NOWHERE)
        worst = worst_case(cases)
        there = [case for case in cases if case.pose == worst.pose]
        near = tuple(case.hand for case in there if case.kind == NOWHERE)
        held = {name: hand for name, hand in hands.items() if name not in near}
        steps.found = f"{worst.verdict}, at {worst.growth:.3g} 1/s in {worst.hand}"
        hardest = hardest_first(cases)
        margin, remedies = improvements(
            read, worst.at or named[worst.pose], held, bounds, worst, visits, hardest, work, steps
        )
        with linearisable(short_read) as (_, system, removed):
            frozen = (*removed, *frozen_nonlinearities.describe_switches(system))
    return Stability(
        title=read.title,
        bounds=bounds,
        poses=tuple(visited),
        hands=hands,
        cases=tuple(cases),
        without=without,
        worst=worst,
        margin=replace(margin, left_out=near),
        remedies=remedies,
        frozen=frozen,
        rounded=rounded,
        stand_ins=find_stand_ins(work.responses),
    )
