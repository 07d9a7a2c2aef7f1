"""What the shape of `coupling`, [iteration] and [step_control] cannot say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from hapticlink.orchestrator.faults import Finding
from hapticlink.orchestrator.scene import Scene
from hapticlink.orchestrator.ticks import exact
from hapticlink.orchestrator.toml_lines import Path

if TYPE_CHECKING:
    from hapticlink.orchestrator.system import Connection, Unit

Problem = tuple[Path, str]


def unfit(
    scene: Scene, units: Iterable[Unit], connections: Iterable[Connection]
) -> Iterator[Finding]:
    """That nothing is there for `coupling = "iterated"` to iterate or interpolate."""
    plants = {u.name: u.clock for u in units if not u.sampled}
    between = any(
        c.source in plants and plants[c.source] == plants.get(c.target) and not c.initial
        for c in connections
    )
    if scene.coupling == "iterated" and not between:
        yield scene.place(
            ("coupling",),
            "'iterated' makes connected plants of one rate agree at the end of their step, and "
            "there are none: take it out (docs/coupling.md)",
        )


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
