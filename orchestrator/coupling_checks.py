"""What the shape of [iteration] and [step_control] cannot say; each yields (path, message)."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.orchestrator.scene import Scene
from hapticlink.orchestrator.ticks import exact
from hapticlink.orchestrator.toml_lines import Path

Problem = tuple[Path, str]


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
