"""The message with which a page begins a run: title, users, rate and power, and its drawing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hapticlink.analysis.findings import labels
from hapticlink.analysis.findings.episode_thresholds import NOTICEABLE_J
from hapticlink.orchestrator.base.signal_names import CONTROLLER, DEVICE, HAND
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import Connection, System
from hapticlink.visualization.interactive_scene.offered_controls import users
from hapticlink.visualization.mechanism.marks import KINDS, SHAPES
from hapticlink.visualization.mechanism.picture import PORT, Picture


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


def drawn(picture: Picture) -> dict[str, Any]:
    """Of the drawing: `marks` and the `shapes` that they name, what states mean (`kinds`), the name
    of the user's `port`, and the `noticeable` energy (J)."""
    return {
        "marks": [mark._asdict() for mark in picture.marks],
        "shapes": SHAPES,
        "kinds": KINDS,
        "port": PORT,
        "noticeable": NOTICEABLE_J,
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
