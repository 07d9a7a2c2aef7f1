"""Which FMUs can run at a clock whose steps differ: one with a phase, or of a rate that varies.

An FMU says so by canHandleVariableCommunicationStepSize (FMI 2.0.5 section 4.3.1).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from hapticlink.orchestrator.clocks import clocks
from hapticlink.orchestrator.faults import Finding
from hapticlink.orchestrator.scene import Scene
from hapticlink.orchestrator.ticks import Timeline

if TYPE_CHECKING:
    from hapticlink.orchestrator.system import Unit

VARIABLE = "canHandleVariableCommunicationStepSize"


def unfit(scene: Scene, units: Iterable[Unit], timeline: Timeline) -> Iterator[Finding]:
    """A finding for each FMU that takes steps of one size only, where its clock's differ."""
    paces, seconds = clocks(scene).paces, timeline.seconds
    for unit in units:
        clock = timeline.clock(unit.clock)
        if clock.first == clock.period or VARIABLE in unit.description.flags:
            continue
        least = seconds(min(clock.first, clock.shortest))
        yield scene.place(
            paces[clock.name].path,
            f"{unit.name} takes steps of one size only ({VARIABLE} is not true), and here they are "
            f"of {least:.6g} to {seconds(clock.longest):.6g} s: take a fixed rate, with neither a "
            "phase nor align = 'tick'",
        )
