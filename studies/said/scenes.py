"""Fresh scenes, each drawn with a seed: linkage, device, hold, rates, hand, gains, walls, users."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import hapticlink as hl

DEVICES = ["twin", "twin", "twin", "twin", "2diy", "stage", "pantograph-mk-ii", "paddle"]
HOLDS = ["zoh", "zoh", "foh", "lead", "passive", "second-order", "slope", "hermite", "model"]
TRIES = 50


def drawn(seed: int) -> tuple[str, dict[str, Any]]:
    """The first scene of a stream that runs for a moment, and its options."""
    rng = np.random.Generator(np.random.PCG64(seed))
    for _ in range(TRIES):
        try:
            base, options = _draw(rng)
            if not hl.run(base, options | {"duration": 0.2}, figures=False).fault:
                return base, options
        except (hl.InputFault, hl.Fault):
            continue
    raise RuntimeError(f"seed {seed}: no scene that runs")


def _draw(rng: np.random.Generator) -> tuple[str, dict[str, Any]]:
    def spread(factor: float) -> float:
        return round(float(np.exp(rng.uniform(-1, 1) * np.log(factor))), 4)

    users, walls = bool(rng.random() < 0.1), bool(rng.random() < 0.15)
    base = "two-users" if users else "enclosure" if walls else "closed-loop-ideal"
    rate = int(rng.choice([256, 400, 512, 800, 1000]))
    whole, device = rng.random() < 0.7, str(rng.choice(DEVICES))
    direct = bool(rng.random() < 0.3) and not (users or walls)
    light = device != "twin" and not users
    soft = 0.3 if direct else 1.0
    stiff = round(100.0 * soft * spread(2.5) * (0.3 if light else 1.0), 2)
    turn = round(0.5 * soft * spread(2.5), 4)
    b = round(float(rng.uniform(round(stiff * 0.1, 3), round(stiff * 0.4, 3))), 3)
    options: dict[str, Any] = {
        "haptics.rate": rate,
        "graphics.rate": f"{rate}/{rng.integers(4, 32)}" if whole else int(rng.integers(12, 70)),
        "hold": str(rng.choice(HOLDS)),
        "controller.teleoperation.stiffness": [stiff, stiff, turn],
        "controller.teleoperation.damping": [b, b, round(turn * float(rng.uniform(0.1, 0.6)), 4)],
        "controller.topology": bool(rng.random() < 0.5),
        "stop_when": "",
    }
    if direct:
        options |= {"mechanism_at": "graphics", "directions_from": "mechanism"}
    if light:
        options |= {"device.extends": device, "controller.bias": "full"}
    if rng.random() < 0.1 and not (users or direct):
        low = int(rng.integers(15, 40))
        options["graphics.rate"] = {"min": low, "max": low + 12, "seed": int(rng.integers(99))}
        options["controller.topology"] = True
    if rng.random() < 0.2:
        late = float(rng.integers(1, 4)) / rate
        options["delays"] = {"virtual_mechanism.x": late, "virtual_mechanism.v": late}
    if not (users or walls):
        options |= _linkage(rng, spread)
    kind = "none" if users else str(rng.choice(["constant", "constant", "damped", "spring", "arm"]))
    if isinstance(options["graphics.rate"], Mapping):
        kind = "spring"
    force = [round(float(f), 3) for f in rng.uniform(-0.6, 0.6, 2)]
    if kind in ("constant", "damped"):
        options["hand"] = {"type": "constant", "wrench": [*force, 0.0]}
        if kind == "damped":
            d = round(float(rng.uniform(0.5, 8.0)), 2)
            options["hand"]["damping"] = [d, d, round(1e-3 * d, 5)]
    elif kind != "none":
        place = _point(base, options)
        k = round(100.0 * spread(3.0), 1)
        about = {"stiffness": [k, k, k / 300], "damping": [k / 30, k / 30, k / 9000]}
        options["hand"] = {"type": kind, "target": [[0.0, *place]], **about}
    return base, options


def _linkage(rng: np.random.Generator, spread: Any) -> dict[str, Any]:
    """Own masses, and lengths of a five-bar; or a serial chain; with gravity and springs or not."""
    kind = str(rng.choice(["five-bar", "serial", "triple", "slider"]))
    options: dict[str, Any] = {}
    names = ["link1", "link2", "link3"][: {"serial": 2, "triple": 3}.get(kind, 2)]
    a, m = [round(0.042 * spread(1.3), 4) for _ in range(3)], [spread(2.5) for _ in range(4)]
    if kind == "five-bar":
        for i in (1, 2, 3, 4):
            options[f"linkage.body.link{i}.mass"] = m[i - 1]
            options[f"linkage.body.link{i}.inertia"] = round(2.1e-4 * m[i - 1] * spread(2.0), 7)
    else:
        last = names[-1]
        bodies = [
            {"name": n, "mass": w, "inertia": round(2e-4 * w, 7), "center": [length / 2, 0.0]}
            for n, w, length in zip(names, m, a, strict=False)
        ]
        angles = [
            round(float(x), 3)
            for x in np.array([0.4, -1.9, 0.5]) + np.array([0.8, 0.8, 0.7]) * rng.uniform(size=3)
        ]
        joints = [
            {"name": f"joint{i}", "child": n, "damping": round(0.002 * spread(3.0), 5)}
            | ({"parent": names[i - 1], "at_parent": [a[i - 1], 0.0]} if i else {})
            for i, n in enumerate(names)
        ]
        linkage: dict[str, Any] = {
            "operational_point": {"body": last, "at": [a[len(names) - 1] / 2, 0.0]},
            "body": bodies,
            "joint": joints,
            "start": {f"joint{i}": x for i, x in enumerate(angles[: len(names)])},
        }
        if kind == "slider":
            y = round(a[0] * np.sin(angles[0]) + a[1] * np.sin(angles[0] + angles[1]), 5)
            pin = {"name": "pin", "type": "slot", "bodies": ["link2", "ground"]}
            linkage["loop"] = [pin | {"at": [[a[1], 0.0], [0.0, float(y)]], "axis": 0.0}]
        options["linkage"] = linkage
    if rng.random() < 0.15:
        options["linkage.gravity"] = [0.0, round(-1.5 * spread(2.0), 2)]
        options["controller.bias"] = "full"
    return options


def _point(base: str, options: dict[str, Any]) -> list[float]:
    """Where the operational point is at the start."""
    run = hl.run(base, options | {"duration": 0.01, "hand": FREE}, figures=False)
    return [round(float(x), 4) for x in run["virtual_mechanism.x"][0]]


FREE = {"type": "constant", "wrench": [0.0, 0.0, 0.0]}
