"""Gains with which contact and joint constraint feel equally stiff, as stiff as a margin allows.

**Margin.** The stability margin g is the factor on all stiffnesses together, dampings by its root,
at which the linearised map of the co-simulation (stability/) becomes unstable, in the worst of the
poses and hands that are judged (stability_limits.py). The default of 2 (6 dB) is the least gain
margin that textbooks of control ask for (Astrom, Murray, Feedback Systems, 2008, section 9.3).

**Felt stiffness** (felt_stiffness.py) is that of the handle under a wrench at 2 Hz, in one of these
poses.

**Along the run** the limits of search/acceptance.py are kept, too. A projector on the constrained
directions that is held is stale while the mechanism moves, which a linearisation at rest cannot
show: gains that stiffen a constraint can throw the handle off.

**Search** (search/search.py): the largest coupling that holds, each with the stiffness of the
topology controller that makes the constraint feel like the contact; without a contact the largest
stiffness of the topology controller, and then of the coupling. Frames are whole haptic periods on
the way, whose map is short; the result is judged at the scene's own rates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np

from hapticlink.analysis.search.acceptance import METRIC, PEAK, AcceptanceLimits, judged_numbers
from hapticlink.analysis.search.search import COARSE, FINE, raise_laws
from hapticlink.analysis.search.settings import Scales
from hapticlink.analysis.stability.poses import (
    Pose,
    at_equilibrium,
    choose_evenly_spaced,
    simulate_scene,
)
from hapticlink.analysis.stability.resting_scene import RestingScene
from hapticlink.analysis.stability.short_hyperperiod import whole_frames
from hapticlink.analysis.sweep.row import Row
from hapticlink.analysis.tune.felt_stiffness import Feel
from hapticlink.analysis.tune.stability_limits import Judge
from hapticlink.analysis.tune.tuning_result import Tuned as Tuned
from hapticlink.components.dynamics.rendered_directions import rendered_directions
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene

MARGIN, POSES = 2.0, 5
NEAR = {"haptics": (0.75, 1.25), "graphics": (0.5, 2.0)}
"""Neighbouring rates, as factors."""
REMEDY = "take a higher graphics.rate or haptics.rate, or a smaller --margin"

STEADY = "begin with smaller gains of controller.teleoperation and controller.topology"


@one_blas_thread()
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
    with interrupt.defer_signals(), np.errstate(invalid="ignore", over="ignore"):
        tuning = _Tuning(open_scene.load(scene, options), margin, tell, keep)
        scales = tuning.judge_at_own_rates(tuning.search())
        tuning.judge_at_near_rates(scales)
    return tuning.result


class _Tuning:
    """A tuning in progress."""

    result: Tuned
    _resting: Sequence[Pose] = ()
    """The poses in which the scene has an equilibrium, and its states there by the pose's name."""
    _states: Mapping[str, Vector]

    def __init__(
        self,
        read: Scene,
        margin: float,
        tell: Callable[[str], object],
        keep: Callable[[Tuned], object],
    ) -> None:
        self._read, self._margin, self._tell, self._keep = read, margin, tell, keep
        self._linkage, device = required(read)
        self._limits = AcceptanceLimits.of(device)
        self._rendered = rendered_directions(device.handle, device.space)

    def search(self) -> Scales:
        """The scales of the largest gains with which margin and run hold, with `whole_frames`."""
        quick, _ = whole_frames(self._read)
        self._tell("the scene's own run, for its poses")
        run = simulate_scene(self._read)
        moments = choose_evenly_spaced(run, self._linkage, POSES)
        with at_equilibrium(quick, moments, self._tell) as (resting, held):
            pressed = [pose for pose in resting if pose.touches]
            if any(pose.touches for pose in moments) and not pressed:
                raise InputFault(
                    f"the run touches, but no pose in contact has an equilibrium; {STEADY}"
                )
            self._resting = resting
            self._states = {name: place.equilibrium for name, place in held.items()}
            felt_at = (pressed or resting[:1])[-1].name
            judge, feel = Judge(held), Feel.of(held[felt_at], self._linkage, self._rendered)
            self._tell("the margin of the scene's own gains")
            own = judge.margin({}, COARSE)
            self._tell(f"  {own:.3g}")
            start = dict.fromkeys(judge.laws, min(1.0, own / self._margin))
            row = judged_numbers(run)
            _, broken = self._limits.beside(row)
            if broken:
                self._tell(f"  the scene's own run breaks the limits: {broken}")
            first = row if own >= self._margin else self._run(feel, start)
            self._limits, _ = self._limits.beside(first)
            self.result = Tuned(
                run=replace(run, tables={}),
                asked=self._margin,
                poses=resting,
                felt_at=felt_at,
                along=feel.along,
                margins={"scene": own},
                felt={"scene": feel.felt(feel.compliance({}))},
                motion={"scene": motion(row)},
                own_run_breaks=broken,
            )

            def require(scales: Scales) -> None:
                if why := judge.unstable(scales, self._margin):
                    raise InputFault(why)
                self._require_limits(feel, scales)
                self._take(feel, scales)

            self._tell("gains that keep the margin and the limits of a run")
            laws, complete = [law for law in ("topology", "drift") if law in start], None
            if len(laws) == len(feel.along) == 2:
                laws, complete = ["drift"], feel.alike
            try:
                scales, self.result.limited_by = raise_laws(laws, start, require, complete)
            except InputFault as fault:
                raise InputFault(f"no gains keep margin and limits: {fault}; {REMEDY}") from None
        return scales

    def _require_limits(self, feel: Feel, scales: Scales) -> None:
        """Raises InputFault for gains whose run breaks a limit."""
        row = self._run(feel, scales)
        if why := self._limits.why_not(row):
            raise InputFault(why)
        self.result.motion["tuned"] = motion(row)

    def judge_at_own_rates(self, scales: Scales) -> Scales:
        """The scales, lowered where the margin at the scene's own rates asks for it."""
        self._tell("the margin at the scene's own rates")
        with self._at_equilibrium(self._read) as (self.result.poses, held):
            judge = Judge(held)
            feel = Feel(held[self.result.felt_at], self.result.along)
            reached = judge.margin(scales)
            if reached < self._margin * (1 - 2 * FINE):
                scales = {law: s * reached / self._margin for law, s in scales.items()}
                self.result.limited_by = "the margin at the scene's own rates"
                reached = judge.margin(scales)
                try:
                    self._require_limits(feel, scales)
                except InputFault as fault:
                    why = f"no gains keep the margin at the scene's own rates and limits: {fault}"
                    raise InputFault(f"{why}; {REMEDY}") from None
            self.result.margins["tuned"] = reached
            self._take(feel, scales)
        return scales

    def judge_at_near_rates(self, scales: Scales) -> None:
        """Adds the margins at neighbouring rates to the result, 0 where there is no equilibrium."""
        margins = self.result.margins
        for rate in near_rates(self._read):
            near, _ = whole_frames(open_scene.load(self._read, [rate]))
            try:
                with self._at_equilibrium(near) as (_, held):
                    margins[rate] = Judge(held).margin(scales, COARSE)
            except InputFault:
                margins[rate] = 0.0
            self._tell(f"margin at {rate}: {margins[rate]:.3g}")
            self._keep(self.result)

    def _take(self, feel: Feel, scales: Scales) -> None:
        """These gains are the best so far."""
        result = self.result
        result.gains, X = feel.gains.options(scales), feel.compliance(scales)
        result.compliance, result.felt["tuned"] = X, feel.felt(X)
        felt = (f"{name} {value:.4g} N/m" for name, value in result.felt["tuned"].items())
        times = (f"{scale:.3g} ({law})" for law, scale in scales.items())
        self._tell(f"  {', '.join(felt)}: gains times {', '.join(times)}")
        self._keep(result)

    def _run(self, feel: Feel, scales: Scales) -> Row:
        return judged_numbers(simulate_scene(self._read, feel.gains.options(scales)))

    def _at_equilibrium(
        self, read: Scene
    ) -> AbstractContextManager[tuple[list[Pose], dict[str, RestingScene]]]:
        return at_equilibrium(read, self._resting, self._tell, self._states)


def motion(row: Row) -> dict[str, float]:
    """The largest distance (m) of handle and operational point, infinite where the run fails, and
    the largest energy (J) that was generated at the user's port."""
    distance = np.inf if row["message"] else row.get(METRIC, np.inf) / 1e3
    return {"distance": distance, "energy_peak": row.get(PEAK, np.nan)}


def required(read: Scene) -> tuple[Linkage, Device]:
    """The linkage and the device of a scene. Raises InputFault where there are no gains to tune, or
    where they are not felt."""
    if not (read.linkage and read.controller and read.device and read.hand):
        raise InputFault(
            "no gains to tune: a [linkage], [device], [controller] and [hand] are needed"
        )
    if read.sensing == "ideal":
        raise InputFault(
            "with ideal sensing the motors cancel the hand's wrench along a joint constraint: it "
            "feels rigid whatever the gains; take --set sensing=encoders"
        )
    if read.contacts and not read.controller.contact:
        raise InputFault("contacts are not sent to the hand: take --set controller.contact=true")
    return read.linkage, read.device


def near_rates(read: Scene) -> Iterator[str]:
    """Options with a neighbouring rate each."""
    for key, factors in NEAR.items():
        if (part := getattr(read, key)) is not None:
            for factor in factors:
                yield f"{key}.rate={round(float(exact(part.rate)) * factor)}"
