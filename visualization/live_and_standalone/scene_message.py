"""The message with which a page begins a run: title, users, rate and power."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hapticlink.analysis.findings import labels
from hapticlink.orchestrator.base.signal_names import CONTROLLER, DEVICE, HAND
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import Connection, System
from hapticlink.visualization.live_and_standalone.offered_controls import users


def running(scene: Scene, system: System, meters: Iterable[str]) -> dict[str, Any]:
    """Of the run: `users` by point, the rate of the `haptics` (Hz), and `power`, one entry for each
    connection with an energy meter."""
    timeline = system.timeline
    return {
        "type": "scene",
        "title": scene.title,
        "users": [*users(scene)],
        "haptics": float(1 / (timeline.clocks[0].longest * timeline.base)),
        "power": power(system, meters),
    }


def power(system: System, connections: Iterable[str]) -> list[dict[str, Any]]:
    """Of each connection that carries power, its `words`, whether a `hand` does work there on its
    handle or on a further point, and whether what is put in there `counts`: what a controller
    passes on was not put in by it."""
    on = [system.connection[name] for name in connections]
    handles = {c.source for c in on if system.block(c.target) == DEVICE}

    def hand(c: Connection) -> bool:
        if system.block(c.source) != HAND:
            return False
        return system.block(c.target) == DEVICE or c.source not in handles

    return [
        {
            "name": c.name,
            "words": labels.connection(c.name),
            "hand": hand(c),
            "counts": system.block(c.source) != CONTROLLER,
        }
        for c in on
    ]
