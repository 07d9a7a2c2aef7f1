"""Draws around a scene: its hand stronger and weaker, in other directions, and rates beside its
own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from hapticlink.components.specs.hand import (
    ArmHand,
    ConstantHand,
    FingertipHand,
    ProfileHand,
    SpringHand,
)
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.scene import Scene

FACTOR, TURN, RATE = 1.4, 0.4, 0.05
"""Largest factor on a hand's forces and impedances, turn of its force (rad), and relative change of
the graphics rate."""
IMPEDANCES = ("mass", "stiffness", "damping", "grip_stiffness", "grip_damping")


def draws(scene: Scene, count: int, seed: int) -> Iterator[tuple[str, ...]]:
    """The options of `count` draws; the same for the same seed."""
    generator = np.random.default_rng(seed)
    for _ in range(count):
        drawn: dict[str, Any] = {"hand": _hand(scene, generator)}
        graphics = scene.graphics
        if graphics is not None and isinstance(graphics.rate, int | float | str):
            rate = float(exact(graphics.rate)) * generator.uniform(1 - RATE, 1 + RATE)
            drawn |= {"graphics.rate": round(rate, 2)}
        yield overrides.write_options({key: value for key, value in drawn.items() if value})


def _hand(scene: Scene, generator: np.random.Generator) -> dict[str, Any]:
    """The table of a hand that is drawn around the scene's."""
    hand = scene.hand
    factor = float(FACTOR ** generator.uniform(-1, 1))
    c, s = (f(generator.uniform(-TURN, TURN)) for f in (np.cos, np.sin))

    def turned(wrench: Any) -> list[float]:
        x, y, moment = (factor * float(value) for value in wrench)
        return [float(c * x - s * y), float(s * x + c * y), moment]

    found: dict[str, Any] = {} if hand is None else asdict(hand)
    found = {key: value for key, value in found.items() if value is not None}
    match hand:
        case ConstantHand():
            found["wrench"] = turned(hand.wrench)
        case ProfileHand(table=tuple() as table):
            found["table"] = [[row[0], *turned(row[1:])] for row in table]
        case ProfileHand():
            sine = found["table"]
            found["table"] = sine | {key: turned(sine[key]) for key in ("mean", "amplitude")}
        case ArmHand() | SpringHand():
            for key in IMPEDANCES:
                if key in found:
                    factor = float(FACTOR ** generator.uniform(-1, 1))
                    found[key] = [factor * float(value) for value in found[key]]
        case FingertipHand():
            for key, value in found.items():
                if isinstance(value, float):
                    found[key] = float(FACTOR ** generator.uniform(-1, 1)) * value
    return found
