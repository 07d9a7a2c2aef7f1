"""The verdict on the run behind a page: of the FMUs of its scene with all that was changed on the
page, where the handles are at the start, held by the mouse and by hands from soft to firm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.analysis.stability.frozen_nonlinearities import has_friction
from hapticlink.analysis.stability.hand_cases import Case, InHands, worst_case
from hapticlink.analysis.stability.hands import hands_in
from hapticlink.analysis.stability.lifted_map import hyperperiod
from hapticlink.analysis.stability.modes import DRIFT
from hapticlink.analysis.stability.resting_scene import resting_system
from hapticlink.analysis.stability.state_vector import size
from hapticlink.components.specs.hand import SpringHand
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.base.errors import Fault, InputFault
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.orchestrator.system.changes import with_hold
from hapticlink.orchestrator.system.system import Fmu, System
from hapticlink.orchestrator.system.timeline import timeline
from hapticlink.visualization.live_and_standalone.offered_controls import JITTER, RATE, Settings
from hapticlink.visualization.live_and_standalone.viewed_scene import mouse

MAX_COST = {"native": 2e8, "python": 1e7}
"""Haptic ticks of a hyperperiod times the square of the numbers of the state, up to which the map
is computed, by the packaging of the FMUs: some 2 s of processor time."""
MOUSE = "the mouse"
SO_FAR = 3
"""Hands after which there is a first verdict: the mouse, a light touch and a firm grip."""
RATES = range(1, 201)
"""Graphics rates (Hz) that may be suggested in place of a slow one."""

Parameters = Mapping[str, Sequence[float]]
"""Tunable parameters, `fmu.port`, with their values."""


def predict_stability(scene: Scene, settings: Settings, parameters: Parameters) -> dict[str, str]:
    """`verdict` ("" where there is none), that in the hand of the `mouse` alone, `said`, which is
    its one line on the page, and `why`, its tooltip."""
    *_, last = predict_stepwise(scene, settings, parameters)
    return last


def predict_stepwise(
    scene: Scene, settings: Settings, parameters: Parameters
) -> Iterator[dict[str, str]]:
    """As `predict_stability`, of the first hands so far, which are not called stable before all
    are judged, and then of all."""
    cases: list[Case] = []
    try:
        for case, beside in judge_hands(scene, settings, parameters):
            cases.append(case)
            if len(cases) == SO_FAR:
                yield _verdict(cases, beside, so_far=True)
    except Fault as fault:
        first = str(fault).partition(";")[0].partition("\n")[0]
        yield {"verdict": "", "said": f"not computed: {first}", "why": str(fault)}
    else:
        yield _verdict(cases, beside)


def _verdict(cases: Sequence[Case], beside: str, so_far: bool = False) -> dict[str, str]:
    worst = worst_case(cases)
    verdict = "marginal" if worst.drifts else worst.verdict
    mouse = next(case for case in cases if case.hand == MOUSE)
    calm = "; stable in the mouse's hand" if mouse.verdict == "stable" != worst.verdict else ""
    said = f"{_summary(worst, len(cases))}{calm}{beside}{', so far' if so_far else ''}"
    if so_far and verdict != "unstable":  # what only the worst of all hands tells
        verdict = ""
    lines = (
        f"{case.hand}: {case.verdict}, growth rate {case.growth:.4g} 1/s, {case.hertz:.3g} Hz"
        for case in cases
    )
    return {"verdict": verdict, "mouse": mouse.verdict, "said": said, "why": "\n".join(lines)}


def judge_hands(
    scene: Scene, settings: Settings, parameters: Parameters
) -> Iterator[tuple[Case, str]]:
    """The cases of the run, a hand each, and which friction of holds is taken out of them, in
    words. Raises InputFault where its computation would take long, and as `stability` does."""
    if settings.get(JITTER):
        raise InputFault("with jitter the system never repeats; set the jitter to 0")
    if scene.hand is None or scene.linkage is None:
        raise InputFault("nobody holds the mechanism")
    changed = _at_rate(scene, settings.get(RATE))
    with (
        interrupt.defer_signals(),
        one_blas_thread(),
        np.errstate(invalid="ignore", over="ignore"),
        build_system(scene) as whole,
    ):
        _require_quick(changed, whole)
        system = replace(
            whole,
            timeline=timeline(changed),
            fmus=tuple(_with_parameters(fmu, parameters) for fmu in whole.fmus),
            connections=tuple(
                with_hold(c, settings.get(f"holds.{c.name}"), settings.get(f"delays.{c.name}"))
                for c in whole.connections
            ),
        )
        stiffness, damping = mouse(scene.space)
        pulled = SpringHand(stiffness=stiffness, damping=damping)
        hands = {MOUSE: pulled, **hands_in(scene.space)}
        without, _ = frozen_nonlinearities.without(system)
        calming = {c.hold for c in system.connections if has_friction(c)}
        beside = "".join(f", without the friction of hold {hold}" for hold in calming)
        with resting_system(changed, without) as place:
            in_hands = InHands(place)
            for name, hand in hands.items():
                for case in in_hands.cases("the start", {name: hand}, DRIFT):
                    yield case, beside


def _at_rate(scene: Scene, rate: float | None) -> Scene:
    """The scene at a rate that was set on the page, at which steps end on haptic ticks, for as
    short as its map allows."""
    short = replace(scene, duration=1.0)
    if rate is None or scene.graphics is None:
        return short
    graphics = replace(scene.graphics, rate=rate, phase=None, align="tick")
    return replace(short, graphics=graphics)


def _require_quick(scene: Scene, system: System) -> None:
    """Raises InputFault where the lifted map would take long to compute, with the nearest rate at
    which it would not, if there is one."""
    most = MAX_COST[scene.packaging] / size(system) ** 2
    if (count := _ticks(scene)) <= most:
        return
    if scene.graphics is None or not isinstance(scene.graphics.rate, int | float):
        raise InputFault(f"the system repeats only after {count} ticks")
    rate = scene.graphics.rate
    quick = [r for r in RATES if _ticks(_at_rate(scene, r)) <= most]
    nearest = min(quick, key=lambda r: abs(r - rate), default=None)
    remedy = f", {nearest} Hz would be fast" if nearest else ""
    raise InputFault(f"{rate:g} Hz repeats only after {count} ticks{remedy}")


def _ticks(scene: Scene) -> int:
    """The haptic ticks after which all repeats."""
    time = timeline(scene)
    return hyperperiod(time) // time.clocks[0].longest


def _with_parameters(fmu: Fmu, parameters: Parameters) -> Fmu:
    """An FMU with other start values of parameters."""
    for name, values in parameters.items():
        owner, _, port = name.partition(".")
        if owner == fmu.name:
            scalars = fmu.description.port(port, "parameter")
            fmu = fmu.starting(tuple(zip(scalars, values, strict=True)))
    return fmu


def _summary(worst: Case, hands: int) -> str:
    rate = f"{short(abs(worst.growth))} 1/s"
    if worst.verdict == "stable":
        return f"stable in all {hands} hands, decays {rate}"
    if worst.verdict == "marginal":
        return f"marginal in {worst.hand}"
    return f"{worst.kind} of {short(worst.hertz)} Hz, grows {rate}, in {worst.hand}"
