"""Gains with which contact and joint constraint feel equally stiff, as stiff as a margin allows.

**Margin.** The stability margin g is the factor on all stiffnesses together, dampings by its root,
at which the linearised map of the co-simulation (stability/) becomes unstable, in the worst of the
poses and hands that are judged (margin.py). The default of 2 (6 dB) is the least gain margin that
textbooks of control ask for (Astrom, Murray, Feedback Systems, 2008, section 9.3).

**Felt stiffness** (feel.py) is that of the handle under a wrench at 2 Hz, in one of these poses.

**Along the run** (along_the_run.py) the handle must stay near the operational point, too.

**Search** (search.py). Frames are whole haptic periods on the way, whose map is short; the result
is judged at the scene's own rates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from hapticlink.analysis.findings.tracking import tracking
from hapticlink.analysis.tune.felt_stiffness import Feel
from hapticlink.analysis.tune.poses import at_rest, poses
from hapticlink.analysis.tune.requirements import near_rates, required, whole_frames
from hapticlink.analysis.tune.run_measures import TRACKED, motion, simulated
from hapticlink.analysis.tune.search import COARSE, search
from hapticlink.analysis.tune.stability_limits import FINE, Judge
from hapticlink.analysis.tune.tuning_result import Tuned as Tuned
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.overrides import Options

MARGIN, POSES = 2.0, 5
REMEDY = "take a higher graphics.rate or haptics.rate, or a smaller --margin"

STEADY = "begin with smaller gains of controller.teleoperation and controller.topology"


def tune(
    scene: str | Path,
    options: Options = (),
    *,
    margin: float = MARGIN,
    tell: Callable[[str], object] | None = None,
    keep: Callable[[Tuned], object] | None = None,
) -> Tuned:
    """The gains of a scene with which a contact and a joint constraint feel equally stiff, as stiff
    as a stability margin allows in five poses of its own run and in a contact, if there is one.

    `margin` is the factor on all stiffnesses up to instability. `tell` is called with what is done,
    `keep` with the result so far, each time that it is better or knows more.

    Raises InputFault for a margin below 1, a scene without a law to tune or a handle, one whose
    contacts or constraints are not felt by these laws, and one in which no gains hold.
    """
    if not margin >= 1.0:
        raise InputFault(f"margin {margin:g}: give 1 or more, the factor up to instability")
    tell, keep = tell or (lambda text: None), keep or (lambda tuned: None)
    given = overrides.written(options)
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"):
        read = open_scene.load(scene, given)
        linkage = required(read)
        quick = whole_frames(read, given)
        tell("the scene's own run, for its poses")
        run = simulated(scene, given)
        found = poses(run, linkage, POSES)
        touched = any(any(pose.press) for pose in found)
        with at_rest(scene, quick, found, tell) as (found, at):
            pressed = [pose for pose in found if any(pose.press)]
            if touched and not pressed:
                raise InputFault(f"the run touches, but rests in no pose in contact; {STEADY}")
            rests = {name: place.rest for name, place in at.items()}
            felt_at = (pressed or found[:1])[-1].name
            judge, feel = Judge(at), Feel.of(at[felt_at], linkage)
            tell("the margin of the scene's own gains")
            own = judge.margin({}, COARSE)
            tell(f"  {own:.3g}")
            start = dict.fromkeys(judge.laws, min(1.0, own / margin))
            held_back = run if own >= margin else simulated(scene, given, feel.gains.options(start))
            within, end = TRACKED * motion(held_back)["distance"], tracking(held_back)[0][-1]
            if not np.isfinite(within):
                raise InputFault(f"the scene's own run fails: {held_back.run['fault']}")
            result = Tuned(
                run=replace(run, tables={}),
                asked=margin,
                poses=found,
                felt_at=felt_at,
                along=feel.along,
                margins={"scene": own},
                felt={"scene": feel.felt(feel.compliance({}))},
                motion={"scene": motion(run)},
            )

            def take(feel: Feel, scales: dict[str, float]) -> None:
                result.gains, X = feel.gains.options(scales), feel.compliance(scales)
                result.compliance, result.felt["tuned"] = X, feel.felt(X)
                felt = (f"{name} {value:.4g} N/m" for name, value in result.felt["tuned"].items())
                times = (f"{scale:.3g} ({law})" for law, scale in scales.items())
                tell(f"  {', '.join(felt)}: gains times {', '.join(times)}")
                keep(result)

            def require(scales: dict[str, float]) -> None:
                if why := judge.unstable(scales, margin):
                    raise InputFault(why)
                moved = motion(simulated(scene, given, feel.gains.options(scales)), end)
                if not moved["distance"] <= within:
                    raise InputFault(
                        f"the run: the handle may leave its point by {1e3 * within:.3g} mm"
                    )
                result.motion["tuned"] = moved
                take(feel, scales)

            tell("gains that keep the margin and the run")
            try:
                scales, result.limited_by = search(start, feel, require)
            except InputFault as fault:
                raise InputFault(f"{fault}; {REMEDY}") from None
        tell("the margin at the scene's own rates")
        with at_rest(scene, given, found, tell, rests) as (result.poses, at):
            judge = Judge(at)
            reached = judge.margin(scales)
            if reached < margin * (1 - 2 * FINE):
                scales = {law: s * reached / margin for law, s in scales.items()}
                reached = judge.margin(scales)
            result.margins["tuned"] = reached
            take(Feel(at[felt_at], feel.along), scales)
        for rate in near_rates(read):
            near = (*given, rate)
            near = whole_frames(open_scene.load(scene, near), near)
            try:
                with at_rest(scene, near, found, tell, rests) as (_, at):
                    result.margins[rate] = Judge(at).margin(scales, COARSE)
            except InputFault:
                result.margins[rate] = 0.0
            tell(f"margin at {rate}: {result.margins[rate]:.3g}")
            keep(result)
    return result
