"""What the records of holds, delays and [step_control] cannot say."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.orchestrator.base.faults import unknown
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.records import Latency
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Problem


def check(scene: Scene) -> Iterator[Problem]:
    """Every fault found."""
    control = scene.step_control
    if control and control.max is not None and exact(control.min) > exact(control.max):
        yield ("step_control", "min"), f"{control.min} s is above max = {control.max} s: swap them"


def holds(scene: Scene) -> Iterator[Problem]:
    if scene.hold not in HOLDS:
        yield ("hold",), unknown("hold", scene.hold, HOLDS)
    if scene.downsampling not in ("latest", "mean"):
        message = unknown("downsampling", scene.downsampling, ("latest", "mean"))
        yield ("downsampling",), message
    for name, late in scene.delays.items():
        if isinstance(late, Latency) and late.max is not None and late.max < late.min:
            message = f"max = {late.max} s is below min = {late.min} s: swap them"
            yield ("delays", name), message
    for connection, hold in scene.holds.items():
        if hold not in HOLDS:
            yield ("holds", connection), unknown("hold", hold, HOLDS)
