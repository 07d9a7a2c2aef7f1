"""Checks the bounds of [delays] and [step_control] against each other, and signs of [[power]]."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene.records import Latency
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Problem


def check(scene: Scene) -> Iterator[Problem]:
    """A problem where the shortest step is longer than the longest one, and for each sign that is
    none."""
    for i, port in enumerate(scene.power):
        if abs(port.sign) != 1.0:
            yield ("power", i, "sign"), f"{port.sign:g} is no sign: write 1 or -1"
    control = scene.step_control
    if control and control.max is not None and exact(control.min) > exact(control.max):
        yield ("step_control", "min"), f"{control.min} s is above max = {control.max} s: swap them"


def delays(scene: Scene) -> Iterator[Problem]:
    for name, late in scene.delays.items():
        if isinstance(late, Latency) and late.max is not None and late.max < late.min:
            message = f"max = {late.max} s is below min = {late.min} s: swap them"
            yield ("delays", name), message
