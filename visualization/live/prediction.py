"""What the lifted map says of the run behind a page: of the FMUs of its scene with all that was
changed on the page, in hands that hold the handles where they are at the start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hapticlink.analysis.stability.lifted_map import hyperperiod
from hapticlink.analysis.stability.modes import leading
from hapticlink.analysis.stability.scene_stability import Stability, at_rest
from hapticlink.analysis.stability.state_vector import size
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import Fault, InputFault
from hapticlink.orchestrator.base.loop_names import DEVICE
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import built
from hapticlink.orchestrator.system.changes import held_by
from hapticlink.orchestrator.system.system import Fmu, System
from hapticlink.orchestrator.system.timeline import timeline
from hapticlink.visualization.live.controls import Settings

MAX_COST = {"native": 1e8, "python": 1e7}
"""Haptic ticks of a hyperperiod times the square of the numbers of the state, up to which the map
is computed, by the packaging of the FMUs; 1e7 take about 2 s of processor time with native ones."""
SEARCH = 0.25
"""Simulated time (s) within which an equilibrium is sought."""
RATES = range(1, 201)
"""Graphics rates (Hz) that may be suggested in place of a slow one."""

Parameters = Mapping[str, Sequence[float]]
"""Tunable parameters, `fmu.port`, with their values."""


def predicted(scene: Scene, settings: Settings, parameters: Parameters) -> dict[str, str]:
    """`verdict` ("" where there is none), `said`, which is its one line on the page, and `why`, its
    tooltip."""
    try:
        found = judged(scene, settings, parameters)
    except Fault as fault:
        short = str(fault).partition(";")[0].partition("\n")[0]
        return {"verdict": "", "said": f"not computed: {short}", "why": str(fault)}
    return {"verdict": found.verdict, "said": _summary(found), "why": "\n".join(found.lines())}


def judged(scene: Scene, settings: Settings, parameters: Parameters) -> Stability:
    """The stability of the run. Raises InputFault where its computation would take long, and as
    `stability` does."""
    if settings.jitter:
        raise InputFault("with jitter the system never repeats; set the jitter to 0")
    changed = _at_rate(scene, settings.rate)
    with (
        interrupt.held(),
        np.errstate(invalid="ignore", over="ignore"),
        built(scene) as whole,
    ):
        _require_quick(changed, whole)
        s = settings
        system = replace(
            whole,
            timeline=timeline(changed),
            fmus=tuple(_with_parameters(fmu, parameters) for fmu in whole.fmus),
            connections=tuple(
                held_by(c, s.holds.get(c.name), s.delays.get(c.name)) for c in whole.connections
            ),
        )
        return at_rest(changed, system, 0.0, SEARCH)


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
    starts = {scalar.name: (scalar, value) for scalar, value in fmu.starts}
    for name, values in parameters.items():
        owner, _, port = name.partition(".")
        if owner == fmu.name:
            scalars = fmu.description.port(port, "parameter")
            starts |= {s.name: (s, v) for s, v in zip(scalars, values, strict=True)}
    return replace(fmu, starts=tuple(starts.values()))


def _summary(found: Stability) -> str:
    rate = f"{abs(found.growth):.2g} 1/s"
    if found.verdict == "stable":
        return f"stable at rest, decays {rate}"
    if found.verdict == "marginal":
        return "marginal at rest"
    owners = [name.partition(".")[0] for name in found.names]
    whose = leading(found.modes[0], owners, 1)[0][0] if found.modes else "all"
    whose = whose.replace("virtual_", "").replace(DEVICE, "handle").replace("_", " ")
    return f"unstable, grows {rate}, mode of {whose}"
