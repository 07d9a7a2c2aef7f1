"""Gains with which contact and joint constraint feel equally stiff, as stiff as a margin allows.

**Margin.** The stability margin g is the factor on all stiffnesses together, dampings by its root,
at which the linearised map of the co-simulation (stability/) becomes unstable, in the worst of the
poses and hands that are judged. The default of 2 (6 dB) is the least gain margin that textbooks of
control ask for (Astrom, Murray, Feedback Systems, 2008, section 9.3).

**Felt stiffness.** The dynamic stiffness 1/|n' X n| at the handle (held.py), at a frequency of
pressing, by default 2 Hz: of a joint constraint along the wrench that no motion of the mechanism
answers, n in null(S Lambda^-1 S), the stiffest of them; of a contact along its wrench.

**Search.** Each law alone is taken to its limit of stability, which sets the ratios of the laws; a
common factor takes them to the limit together, and by the margin back. Then the law of what feels
stiffer is softened until both feel alike, and what that adds to the margin goes to all laws.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.tune.held import Held, held
from hapticlink.orchestrator.tune.poses import Pose, poses
from hapticlink.orchestrator.tune.search import Search
from hapticlink.orchestrator.tune.tuned import Tuned as Tuned

MARGIN, HERTZ = 2.0, 2.0
RATES = {"haptics.rate": (0.75, 1.25), "graphics.rate": (0.5, 2.0)}
"""Neighbouring rates, as factors."""
Tell = Callable[[str], object]


def tune(
    scene: str | Path,
    options: Options = (),
    *,
    margin: float = MARGIN,
    hertz: float = HERTZ,
    neighbours: bool = True,
    tell: Tell | None = None,
) -> Tuned:
    """The gains of a scene with which a contact and a joint constraint feel equally stiff, as stiff
    as a stability margin allows; it is run once to find a contact.

    `margin` is the factor on all stiffnesses up to instability, `hertz` the frequency of pressing
    (Hz) at which the felt stiffness is taken. `neighbours`: whether margins at neighbouring rates
    are found, too. `tell` is called with what has been found so far.

    Raises InputFault for a margin below 1, a scene without a law to tune or a handle, and one that
    is unstable with any gains.
    """
    tell = tell or (lambda text: None)
    if not margin >= 1.0:
        raise InputFault(f"--margin {margin}: give 1 or more, the factor up to instability")
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"), ExitStack() as stack:
        given = overrides.written(options)
        read = open_scene.load(scene, given)
        found = poses(scene, given)
        tell(f"poses: {', '.join(pose.name for pose in found)}")
        at = _opened(scene, given, found, stack)
        search = Search(at, {pose.name: pose.along for pose in found}, hertz)
        own, before = search.common({}), search.felt({})
        limits = {}
        for law in search.laws:
            limits[law] = search.alone(law)
            tell(f"{law}: unstable alone at {limits[law]:.4g} times the gains of the scene")
        top = search.common(limits)
        scales = {law: limit * top / margin for law, limit in limits.items()}
        scales, reached = search.balanced(scales, margin)
        result = Tuned(
            read.title,
            given,
            search.tables(scales),
            scales,
            reached,
            own,
            search.felt(scales),
            before,
            found,
            limits,
            margin,
            hertz,
            search.compliances(scales),
        )
    if neighbours:
        for key, value in _rates(read):
            tell(f"margin at {key} = {value:g}")
            rate = f"{key}={value:g}"
            result.neighbours[rate] = margin_of(scene, (*given, rate), found, scales)
    return result


def margin_of(
    scene: str | Path,
    options: Options,
    found: Sequence[Pose],
    scales: Mapping[str, float] | None = None,
) -> float:
    """The margin g of scaled gains in the poses `found` of a scene; 0 where it comes to no rest."""
    given = overrides.written(options)
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"), ExitStack() as stack:
        try:
            return Search(_opened(scene, given, found, stack), {}, HERTZ).common(scales or {})
        except InputFault:
            return 0.0


def _opened(
    scene: str | Path, given: tuple[str, ...], found: Sequence[Pose], stack: ExitStack
) -> dict[str, Held]:
    scenes = {pose.name: open_scene.load(scene, pose.options(given)) for pose in found}
    return {name: stack.enter_context(held(read)) for name, read in scenes.items()}


def _rates(read: Any) -> list[tuple[str, float]]:
    found = []
    for key, factors in RATES.items():
        part = getattr(read, key.partition(".")[0])
        rate = getattr(part, "rate", None)
        if isinstance(rate, int | float):
            found += [(key, float(round(rate * factor))) for factor in factors]
    return found
