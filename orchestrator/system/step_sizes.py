"""Step sizes as parameters of this project's FMUs, which are built for no rate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from hapticlink.components.ports import FRAME_SIZE, STEP_SIZE
from hapticlink.orchestrator.base.signal_names import ENVIRONMENT
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.system.system import Fmu


def sizes(clock: str, timeline: Timeline) -> dict[str, float]:
    """The longest steps (s) of an FMU's clock and of the graphics copy, by parameter."""
    clocks = {STEP_SIZE: clock} | (
        {FRAME_SIZE: timeline.of[ENVIRONMENT]} if ENVIRONMENT in timeline.of else {}
    )
    return {n: timeline.seconds(timeline.clock(c).longest) for n, c in clocks.items()}


def with_sizes(fmu: Fmu, timeline: Timeline) -> Fmu:
    """A block's FMU with the step sizes of `timeline` as start values, unless it has others."""
    if fmu.description.block is None:
        return fmu
    given, own = {s.name for s, _ in fmu.starts}, sizes(fmu.clock, timeline)
    wanted = (s for s in fmu.description.scalars if s.causality == "parameter" and s.name in own)
    starts = tuple((s, own[s.name]) for s in wanted if s.name not in given)
    return replace(fmu, starts=fmu.starts + starts)


def too_long(fmu: Fmu) -> Iterator[str]:
    """What is wrong with a step size that an FMU's equations do not suit."""
    for scalar, value in fmu.starts:
        if scalar.name == STEP_SIZE and scalar.bound and float(value) > scalar.bound:
            yield (
                f"{fmu.name}: the `friction_speed` or `friction_deflection` of a joint is too fast "
                f"for steps of {value:.3g} s: it allows {scalar.bound:.3g} s; leave it out, take a "
                "larger one, a higher rate, more `mechanism.substeps`, or `mechanism.integrator` = "
                "'linearly-implicit'"
            )
