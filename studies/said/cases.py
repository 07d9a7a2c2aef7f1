"""Fresh scenes, each drawn with a seed: linkage, device, hold, rates, hand, gains, walls, users."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import hapticlink as hl

DEVICES = ["twin", "twin", "twin", "twin", "2diy", "stage", "pantograph-mk-ii", "paddle"]
HOLDS = ["zoh", "zoh", "foh", "lead", "passive", "second-order", "slope", "hermite", "model"]
KINDS = ["constant", "constant", "damped", "spring", "arm"]
ANGLES = {"five-bar": (), "serial": (0.4, -1.9), "triple": (0.4, -1.9, 0.5), "slider": (0.4, -1.9)}
"""Angles from which those of own chains are drawn, up to 0.8 rad more."""
TRIES = 50


class Draws:
    """The stream of a seed."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.Generator(np.random.PCG64(seed))

    def happens(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def one_of(self, items: Any) -> Any:
        return items[int(self.rng.integers(len(items)))]

    def times(self, factor: float) -> float:
        """From 1/factor to factor, its logarithm even."""
        return round(float(np.exp(self.rng.uniform(-1, 1) * np.log(factor))), 4)

    def between(self, low: float, high: float) -> float:
        return round(float(self.rng.uniform(low, high)), 4)


def drawn(seed: int) -> tuple[str, dict[str, Any]]:
    """The first scene of a stream that runs for a moment, and its options."""
    draws = Draws(seed)
    for _ in range(TRIES):
        try:
            base, options = _draw(draws)
            if not hl.run(base, options | {"duration": 0.2}, figures=False).fault:
                return base, options
        except (hl.InputFault, hl.Fault):
            continue
    raise RuntimeError(f"seed {seed}: no scene that runs")


def _draw(d: Draws) -> tuple[str, dict[str, Any]]:
    base = d.one_of(["closed-loop-ideal"] * 8 + ["two-users", "enclosure"])
    own, users = base == "closed-loop-ideal", base == "two-users"
    rate, device = d.one_of([256, 400, 512, 800, 1000]), d.one_of(DEVICES)
    direct, light = own and d.happens(0.3), device != "twin" and not users
    soft = 0.3 if direct else 1.0
    stiff = round(100.0 * soft * d.times(2.5) * (0.3 if light else 1.0), 2)
    turn, b = round(0.5 * soft * d.times(2.5), 4), round(stiff * d.between(0.1, 0.4), 3)
    slower = d.one_of(range(4, 32))
    options: dict[str, Any] = {
        "haptics.rate": rate,
        "graphics.rate": f"{rate}/{slower}" if d.happens(0.7) else d.one_of(range(12, 70)),
        "hold": d.one_of(HOLDS),
        "controller.teleoperation.stiffness": [stiff, stiff, turn],
        "controller.teleoperation.damping": [b, b, round(turn * d.between(0.1, 0.6), 4)],
        "controller.topology": d.happens(0.5),
        "stop_when": "",
    }
    if direct:
        options |= {"mechanism_at": "graphics", "directions_from": "mechanism"}
    if light:
        options |= {"device.extends": device, "controller.bias": "full"}
    kind = "none" if users else d.one_of(KINDS)
    if own and not direct and d.happens(0.15):
        low = d.one_of(range(15, 40))
        options["graphics.rate"] = {"min": low, "max": low + 12, "seed": d.one_of(range(99))}
        options |= {"controller.topology": True, "hold": "zoh"}
        kind = "spring"
    if d.happens(0.2):
        late = d.one_of([1, 2, 3]) / rate
        options["delays"] = {"virtual_mechanism.x": late, "virtual_mechanism.v": late}
    if own:
        options |= _linkage(d)
    return base, options | _hand(d, kind, base, options)


def _hand(d: Draws, kind: str, base: str, options: Mapping[str, Any]) -> dict[str, Any]:
    if kind == "none":
        return {}
    if kind in ("constant", "damped"):
        b = d.between(0.5, 8.0) if kind == "damped" else 0.0
        damped = {"damping": [b, b, round(1e-3 * b, 6)]} if b else {}
        wrench = [d.between(-0.6, 0.6), d.between(-0.6, 0.6), 0.0]
        return {"hand": {"type": "constant", "wrench": wrench, **damped}}
    free = {"type": "constant", "wrench": [0.0, 0.0, 0.0]}
    run = hl.run(base, {**options, "duration": 0.01, "hand": free}, figures=False)
    place = [round(float(x), 4) for x in run["virtual_mechanism.x"][0]]
    k = round(100.0 * d.times(3.0), 1)
    about = {"stiffness": [k, k, k / 300], "damping": [k / 30, k / 30, k / 9000]}
    return {"hand": {"type": kind, "target": [[0.0, *place]], **about}}


def _linkage(d: Draws) -> dict[str, Any]:
    """Own masses of the five-bar, or a chain of two or three links, or one in a slot; some fall."""
    kind = d.one_of([*ANGLES])
    angles = [round(angle + d.between(0.0, 0.8), 3) for angle in ANGLES[kind]]
    names = [f"link{i + 1}" for i in range(len(angles) or 4)]
    a, m = ([round(x * d.times(f), 4) for _ in names] for x, f in ((0.042, 1.3), (1.0, 2.5)))
    options: dict[str, Any] = {}
    if d.happens(0.15):
        options = {"linkage.gravity": [0.0, -d.between(0.7, 3.0)], "controller.bias": "full"}
    if not angles:
        return options | {f"linkage.body.{n}.mass": x for n, x in zip(names, m, strict=True)}
    linkage: dict[str, Any] = {
        "operational_point": {"body": names[-1], "at": [a[-1] / 2, 0.0]},
        "body": [
            {"name": n, "mass": w, "inertia": round(2e-4 * w, 7), "center": [length / 2, 0.0]}
            for n, w, length in zip(names, m, a, strict=True)
        ],
        "joint": [
            {"name": f"joint{i}", "child": n, "damping": round(0.002 * d.times(3.0), 5)}
            | ({"parent": names[i - 1], "at_parent": [a[i - 1], 0.0]} if i else {})
            for i, n in enumerate(names)
        ],
        "start": {f"joint{i}": angle for i, angle in enumerate(angles)},
    }
    if kind == "slider":
        y = round(float(a @ np.sin(np.cumsum(angles))), 5)
        pin = {"name": "pin", "type": "slot", "bodies": ["link2", "ground"], "axis": 0.0}
        linkage["loop"] = [pin | {"at": [[a[1], 0.0], [0.0, y]]}]
    return {"linkage": linkage, **options}
