"""What the shape of `coupling`, [iteration] and [step_control] cannot say."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.orchestrator.base.faults import unknown
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.records import Latency
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def check(scene: Scene) -> Iterator[Problem]:
    """Every fault found."""
    iteration, control = scene.iteration, scene.step_control
    if iteration.most < 1:
        yield ("iteration", "most"), f"{iteration.most}: at least 1 iteration"
    if iteration.tolerance <= 0:
        yield ("iteration", "tolerance"), f"{iteration.tolerance}: a tolerance is more than 0"
    if control is None:
        return
    for key in ("tolerance", "energy"):
        value = getattr(control, key)
        if value is not None and value <= 0:
            yield ("step_control", key), f"{value}: give more than 0"
    sizes = {}
    for key, value in (("min", control.min), ("max", control.max)):
        try:
            if value is not None and (size := exact(value)) > 0:
                sizes[key] = size
            elif value is not None:
                yield ("step_control", key), f"{value} s: a step is more than 0"
        except (ValueError, ZeroDivisionError):
            yield ("step_control", key), f"{value!r}: write a step as 0.0001 or '1/7680' (s)"
    if len(sizes) == 2 and sizes["min"] > sizes["max"]:
        yield ("step_control", "min"), f"{control.min} s is above max = {control.max} s: swap them"


def holds(scene: Scene) -> Iterator[Problem]:
    if scene.hold not in HOLDS:
        yield ("hold",), unknown("hold", scene.hold, HOLDS)
    if scene.downsampling not in ("latest", "mean"):
        message = unknown("downsampling", scene.downsampling, ("latest", "mean"))
        yield ("downsampling",), message
    for name, steps in scene.substeps.items():
        if steps < 1:
            yield ("substeps", name), f"{steps}: at least 1 substep"
    for name, late in scene.delays.items():
        yield from _latency(("delays", name), late)
    for connection, hold in scene.holds.items():
        if hold not in HOLDS:
            yield ("holds", connection), unknown("hold", hold, HOLDS)


def _latency(path: Path, late: float | Latency) -> Iterator[Problem]:
    given = late if isinstance(late, Latency) else Latency(min=late)
    if given.min < 0:
        yield path, f"{given.min} s: a latency is 0 or more"
    if given.max is not None and given.max < given.min:
        yield path, f"max = {given.max} s is below min = {given.min} s: swap them"
    if not 0 <= given.loss <= 1:
        yield path, f"loss = {given.loss}: a probability is between 0 and 1"
    if given.seed < 0:
        yield path, f"{given.seed}: a seed is 0 or more"
