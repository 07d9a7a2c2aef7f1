"""Checks the bounds of [delays] against each other, and signs of [[power]]."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.orchestrator.scene.records import Latency
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Problem


def check(scene: Scene) -> Iterator[Problem]:
    """A problem for each sign that is none."""
    for i, port in enumerate(scene.power):
        if abs(port.sign) != 1.0:
            yield ("power", i, "sign"), f"{port.sign:g} is no sign: write 1 or -1"


def delays(scene: Scene) -> Iterator[Problem]:
    for name, late in scene.delays.items():
        if isinstance(late, Latency) and late.max is not None and late.max < late.min:
            message = f"max = {late.max} s is below min = {late.min} s: swap them"
            yield ("delays", name), message
