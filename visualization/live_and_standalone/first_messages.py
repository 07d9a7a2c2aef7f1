"""The messages with which a page opens, before anything runs, and begins a run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np

from hapticlink.analysis.findings import labels
from hapticlink.analysis.findings.user_port import NOTICEABLE_J
from hapticlink.components.dynamics.assembly import start_coordinates
from hapticlink.orchestrator.base.signal_names import DEVICE, HAND, PASS_ON
from hapticlink.orchestrator.scene.blocks import described_devices, driver_of
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import Connection, System
from hapticlink.visualization.live_and_standalone.offered_controls import users
from hapticlink.visualization.mechanism.marks import KINDS, SHAPES
from hapticlink.visualization.mechanism.picture import PORT, Picture


def describe_opening(scene: Scene) -> dict[str, Any]:
    """What the server makes `open_page` of, with the title and the arguments of Picture."""
    drawing = (scene.linkage, described_devices(scene), scene.contacts)
    return {"type": "opening", "title": scene.title, "picture": drawing}


def open_page(title: str, *drawing: Any) -> dict[str, Any]:
    """The `picture` of a `drawing`, the arguments of Picture; what `describe_picture` says of it; a
    `frame` of it at the start, None where its loops lead to no finite pose."""
    picture, q = Picture(*drawing), start_coordinates(drawing[0])
    frame = picture.at_rest(q) if np.isfinite(q).all() else None
    about = {"type": "opening", "title": title, "picture": picture, "frame": frame}
    return about | describe_picture(picture)


def describe_picture(picture: Picture) -> dict[str, Any]:
    """`marks` and the `shapes` that they name, the `view` with which they are seen, what states
    mean (`kinds`), the name of the user's `port`, and the `noticeable` energy (J)."""
    return {
        "marks": [mark._asdict() for mark in picture.marks],
        "shapes": SHAPES,
        "view": asdict(picture.view),
        "kinds": KINDS,
        "port": PORT,
        "noticeable": NOTICEABLE_J,
    }


def describe_viewed_run(scene: Scene, system: System, meters: Iterable[str]) -> dict[str, Any]:
    """`users` by point, whether `boards` are held by some, the rate of the `haptics` (Hz), and
    `power`, one entry for each connection with an energy meter."""
    timeline = system.timeline
    return {
        "type": "scene",
        "title": scene.title,
        "users": [*users(scene)],
        "boards": any(driver_of(scene, user) for user in scene.all_devices),
        "haptics": float(1 / (timeline.clocks[0].longest * timeline.base)),
        "power": describe_power(system, meters),
    }


def describe_power(system: System, connections: Iterable[str]) -> list[dict[str, Any]]:
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
            "counts": system.block(c.source) not in PASS_ON,
        }
        for c in on
    ]
