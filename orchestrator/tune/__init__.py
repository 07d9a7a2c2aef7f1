"""Gains with which contact and joint constraint feel equally stiff, as stiff as a margin allows.

**Margin.** The stability margin g is the factor on all stiffnesses together, dampings by its root,
at which the linearised map of the co-simulation (stability/) becomes unstable, in the worst of the
poses and hands that are judged. The default of 2 (6 dB) is the least gain margin that textbooks of
control ask for (Astrom, Murray, Feedback Systems, 2008, section 9.3).

**Felt stiffness.** The dynamic stiffness 1/|n' X n| at the handle (held.py), at a frequency of
pressing, by default 2 Hz: of a joint constraint along the wrench that no motion of the mechanism
answers, n in null(S Lambda^-1 S), the stiffest of them; of a contact along its wrench.

**Along the run.** A held projector on the constrained directions is stale while the mechanism
moves, which no map of a rest knows: gains that stiffen a constraint can throw the handle off. So
the scene is run with the gains, too: the handle may leave the operational point by at most TRACKED
times as far as with the scene's own gains, scaled to the margin where they lack it.

**Search.** The largest coupling that keeps the margin and the run, each with the stiffness of the
topology controller that makes the constraint feel like the contact; without a contact, the largest
stiffness of the topology controller, and then of the coupling. Frames are whole haptic periods
then, whose map is short; the result is judged at the scene's own rates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from hapticlink.components.linkage.parameters import mean_link_length
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt, temporary_folders
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.tables import Results
from hapticlink.orchestrator.results.tracking import tracking
from hapticlink.orchestrator.results.user_port import user_port
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.tune.gains import Gains
from hapticlink.orchestrator.tune.held import Held, Matrix, Vector, held
from hapticlink.orchestrator.tune.poses import Pose, poses
from hapticlink.orchestrator.tune.search import FINE, Judge, largest
from hapticlink.orchestrator.tune.tuned import Tuned as Tuned

MARGIN, HERTZ, POSES = 2.0, 2.0, 5
TRACKED, COARSE = 1.2, 0.05
"""Of the distance of the scene's own run, what the tuned one may have; of the logarithm of a scale,
how well the largest is found."""
RATES = {"haptics": (0.75, 1.25), "graphics": (0.5, 2.0)}
"""Neighbouring rates, as factors."""
REMEDY = "take a higher graphics.rate or haptics.rate, or a smaller --margin"
CONSTRAINED = 1e-6
"""Of the largest scaled mobility, up to which a direction does not move."""
Tell = Callable[[str], object]


def tune(
    scene: str | Path,
    options: Options = (),
    *,
    margin: float = MARGIN,
    hertz: float = HERTZ,
    count: int = POSES,
    neighbours: bool = True,
    tell: Tell = lambda text: None,
    keep: Callable[[Tuned], object] = lambda tuned: None,
) -> Tuned:
    """The gains of a scene with which a contact and a joint constraint feel equally stiff, as stiff
    as a stability margin allows in `count` poses of its own run and in a contact, if there is one.

    `margin` is the factor on all stiffnesses up to instability, `hertz` the frequency of pressing
    (Hz) at which the felt stiffness is taken. `neighbours`: whether margins at neighbouring rates
    are found, too. `tell` is called with what is done, `keep` with each result that keeps the
    margin as far as it is known.

    Raises InputFault for a margin below 1, a scene without a law to tune or a handle, one whose
    contacts or constraints are not felt by these laws, and one that is unstable with any gains.
    """
    if not (margin >= 1.0 and hertz > 0.0 and count >= 1):
        raise InputFault(
            f"margin {margin:g}, hertz {hertz:g}, poses {count}: give a margin of 1 or more, the "
            "factor up to instability, a positive frequency, and one pose or more"
        )
    given = overrides.written(options)
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"):
        read = open_scene.load(scene, given)
        _require(read)
        assert read.linkage
        quick = _whole_frames(read, given)
        tell("the scene's own run, for its poses")
        run = _run(scene, given)
        found = poses(run, read.linkage, count)
        with _opened(scene, quick, found, tell) as at:
            found = [pose for pose in found if pose.name in at]
            rests = {name: place.rest for name, place in at.items()}
            felt_at = found[-1 if any(found[-1].press) else 0]
            along = _wrenches(read.linkage, at[felt_at.name])
            judge = Judge(at, felt_at.name, along, hertz)
            tell("the margin of the scene's own gains")
            own = judge.margin({}, COARSE)
            tell(f"  {own:.3g}")
            share = min(1.0, own / margin)
            lowered = _with(given, judge.gains, _all(judge, share))
            reference = run if share == 1.0 else _run(scene, lowered)
            within, end = TRACKED * _motion(reference)["distance"], tracking(reference)[0][-1]
            result = Tuned(
                run=replace(run, tables={}),
                gains={},
                scales={},
                margin=np.nan,
                limited_by=None,
                own=own,
                felt={},
                felt_before=judge.felt({}),
                felt_at=felt_at.name,
                along={name: tuple(n.tolist()) for name, n in along.items()},
                poses=tuple(found),
                asked=margin,
                hertz=hertz,
                compliance=None,
                motion={"scene": _motion(run)},
            )

            def take(judge: Judge, scales: dict[str, float]) -> None:
                nonlocal result
                result = replace(
                    result,
                    gains=judge.gains.tables(scales),
                    scales=scales,
                    felt=judge.felt(scales),
                    compliance=judge.compliance(scales),
                )
                felt = ", ".join(f"{name} {value:.4g} N/m" for name, value in result.felt.items())
                tell(f"  {felt}: gains times {_text(scales)}")
                keep(result)

            def holds(scales: dict[str, float]) -> bool:
                nonlocal result
                why = judge.unstable(scales, margin)
                if why is None:
                    motion = _motion(_run(scene, _with(given, judge.gains, scales)), end)
                    if motion["distance"] <= within:
                        result.motion["tuned"] = motion
                        take(judge, scales)
                        return True
                    why = f"the run: the handle may leave its point by {1e3 * within:.3g} mm"
                result = replace(result, limited_by=why)
                return False

            tell("gains that keep the margin and the run")
            try:
                scales = _search(judge, share, holds)
            except InputFault as fault:
                why = result.limited_by or "an equal feel"
                raise InputFault(f"no gains keep {why}: {fault}; {REMEDY}") from None
        tell("the margin at the scene's own rates")
        with _opened(scene, given, found, tell, rests) as at:
            judge = Judge(at, felt_at.name, along, hertz)
            reached = judge.margin(scales)
            if reached < margin * (1 - 2 * FINE):
                scales = {law: s * reached / margin for law, s in scales.items()}
                reached = judge.margin(scales)
            result = replace(result, margin=reached)
            take(judge, scales)
        for key, value in _rates(read) if neighbours else ():
            rate = f"{key}.rate={value:g}"
            near = _whole_frames(open_scene.load(scene, (*given, rate)), (*given, rate))
            try:
                with _opened(scene, near, found, tell, rests) as at:
                    judge = Judge(at, next(iter(at)), {}, hertz)
                    result.neighbours[rate] = judge.margin(scales, COARSE)
            except InputFault:
                result.neighbours[rate] = 0.0
            tell(f"margin at {rate}: {result.neighbours[rate]:.3g}")
            keep(result)
    return result


def _search(
    judge: Judge, share: float, holds: Callable[[dict[str, float]], bool]
) -> dict[str, float]:
    """The largest scales that hold, from those of the scene times `share` on. Raises InputFault
    where none do."""
    scales = _all(judge, share)
    if "graphics" in scales:  # it moves the copy alone
        scales["graphics"] *= _largest_of("graphics", scales, holds)
    both = {"drift", "topology"} <= {*scales}
    if both and {"constraint", "contact"} <= {*judge.along}:
        drift = scales["drift"]
        at = largest(lambda s: holds(judge.alike({**scales, "drift": s * drift})), COARSE)
        return judge.alike({**scales, "drift": at * drift})
    for law in ("topology", "drift"):
        if law in scales:
            scales[law] *= _largest_of(law, scales, holds)
    return scales


def _largest_of(
    law: str, scales: dict[str, float], holds: Callable[[dict[str, float]], bool]
) -> float:
    return largest(lambda s: holds({**scales, law: s * scales[law]}), COARSE)


def _all(judge: Judge, scale: float) -> dict[str, float]:
    return dict.fromkeys(judge.laws, scale)


def _run(scene: str | Path, given: Sequence[str]) -> Results:
    """A run of the scene, in memory. Raises InputFault where it has no row."""
    with temporary_folders.room() as room:
        made = simulate(scene, room, tuple(given), csv=False)
        if not made.outcome.published:
            raise InputFault(f"the scene's own run fails: {made.outcome.fault}")
        return made.results


def _with(given: Sequence[str], gains: Gains, scales: dict[str, float]) -> tuple[str, ...]:
    """The options with scaled gains."""
    tables = gains.tables(scales)
    chosen = {f"{key}.{name}": v for key, table in tables.items() for name, v in table.items()}
    return (*given, *overrides.written(chosen))


def _motion(run: Results, end: float = 0.0) -> dict[str, float]:
    """The largest distance (m) of handle and operational point, infinite where the run fails, is
    told to be unstable, or ends before `end` (s), and the largest energy (J) that was generated at
    the user's port."""
    times, distances = tracking(run)
    fails = run.run["fault"] or run.run["unstable"] or times[-1] < end
    port = user_port(run)
    return {
        "distance": np.inf if fails else float(distances.max()) / 1e3,
        "energy_peak": float(port.told["peak"]) if port else np.nan,
    }


def _require(read: Scene) -> None:
    """Raises InputFault for a scene that has no gains to tune, or in which they are not felt."""
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


def _whole_frames(read: Scene, given: tuple[str, ...]) -> tuple[str, ...]:
    """The options with the graphics rate next to that of a scene whose frames are whole haptic
    periods. Raises InputFault for one that varies."""
    if read.graphics is None:
        return given
    if not isinstance(read.graphics.rate, int | float | str):
        raise InputFault(
            "graphics.rate varies, so that there is no map of a period: take a fixed rate, such as "
            "--set graphics.rate=30"
        )
    haptic = exact(read.haptics.rate)
    count = max(1, round(haptic / exact(read.graphics.rate)))
    return (*given, f'graphics.rate="{haptic / count}"')


@contextmanager
def _opened(
    scene: str | Path,
    given: tuple[str, ...],
    found: Sequence[Pose],
    tell: Tell,
    starts: Mapping[str, Vector] = {},
) -> Iterator[dict[str, Held]]:
    """The scene at rest in each pose, by name, looked for from `starts`; poses without rest are
    left out and told. Raises InputFault where none has any."""
    with ExitStack() as stack:
        at = {}
        for pose in found:
            try:
                read = open_scene.load(scene, pose.options(given))
                at[pose.name] = stack.enter_context(held(read, starts.get(pose.name)))
            except InputFault as fault:
                tell(f"  pose at {pose.name} is left out: {fault}")
        tell(f"  {len(at)} poses at rest")
        if not at:
            raise InputFault("the scene comes to no rest in any pose of its run, in a firm grip")
        yield at


def _wrenches(linkage: Linkage, place: Held) -> dict[str, Vector]:
    """The unit wrenches, of a joint constraint and of a contact, along which stiffness is felt.
    Raises InputFault where there is neither."""
    found = {}
    mobility = next(
        values
        for block in ("virtual_environment", "virtual_mechanism")
        if len(values := place.signal(f"{block}.Lambda_inv"))
    ).reshape(3, 3)
    S: Matrix = np.diag([1.0, 1.0, mean_link_length(linkage)])
    values, vectors = np.linalg.eigh(S @ mobility @ S)
    null = [S @ vectors[:, i] for i in range(3) if values[i] < CONSTRAINED * values[-1]]
    if null:
        n = max(null, key=lambda wrench: float(np.hypot(*wrench[:2])))
        found["constraint"] = n / np.hypot(*n[:2])
    F = place.signal("virtual_mechanism.F_env")
    if len(F) and (size := float(np.hypot(*F[:2]))):
        found["contact"] = F / size
    if not found:
        raise InputFault(
            "no direction of the handle is constrained, and nothing touches: no stiffness to tune"
        )
    return found


def _rates(read: Scene) -> Iterator[tuple[str, float]]:
    for key, factors in RATES.items():
        if (part := getattr(read, key)) is not None:
            for factor in factors:
                yield key, round(float(exact(part.rate)) * factor)


def _text(scales: dict[str, float]) -> str:
    return ", ".join(f"{scale:.3g} ({law})" for law, scale in scales.items())
