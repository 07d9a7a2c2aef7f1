"""The cases of the study: what is held, by which hand, with or without contact.

A case has several draws: its hand draws its wrench or path by numpy's PCG64 with the draw's seed,
and so do the periods of a graphics rate that varies. A draw is a block of the design: every method
is tried on the same draws, and methods are compared within a draw.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.orchestrator.scene import overrides

Pose = tuple[float, float, float]
LINKAGES: dict[str, Pose] = {
    "five-bar": (0.04452, 0.01480, -0.7878),
    "four-bar": (0.04487, 0.01342, 0.4355),
    "serial": (0.04455, 0.01485, -0.7854),
    "slider-crank": (-0.00319, 0.02165, -0.2928),
}
"""Linkages with the pose of the operational point at the start (m, m, rad)."""
SHIPPED = {"five-bar": "closed-loop-ideal", "serial": "serial"}
"""Scenes of linkages that are shipped with a device; the others are in linkages/."""
WALLS = {
    "five-bar": (-0.03, 0.068, -0.045, 0.036),
    "serial": (-0.03, 0.068, -0.045, 0.036),
    "four-bar": (0.025, 0.065, -0.007, 0.033),
    "slider-crank": (-0.022, 0.018, 0.0, 0.042),
}
"""Box of each linkage: its least and largest x, and y (m)."""
TRAINED = ("five-bar", "four-bar", "serial")
FORCE, MOMENT, STEP = 0.5, 0.0025, 0.02
"""Wrenches are drawn up to these (N, N.m), steps of an arm's path up to STEP (m)."""
SEEDS, STRIDE = 2, 3
"""Draws of a case, and how far apart the first seeds of two cases are: with a third draw the others
stay what they are."""
AT_REST = "arm 300"


@dataclass(frozen=True)
class Case:
    """A draw of a linkage in a hand (`arm 300` is an arm of 300 N/m)."""

    linkage: str
    hand: str
    contact: bool
    seed: int

    @property
    def name(self) -> str:
        return f"{self.linkage}, {self.hand}{', contact' * self.contact}"

    @property
    def scene(self) -> str:
        own = Path(__file__).parent / "linkages" / f"{self.linkage}.toml"
        return SHIPPED.get(self.linkage) or str(own)

    @cached_property
    def options(self) -> tuple[str, ...]:
        """The options of the case on its scene."""
        found: dict[str, Any] = {"hand": _hand(self)}
        if self.contact:
            x0, x1, y0, y1 = WALLS[self.linkage]
            found["contacts.enclosure"] = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
            found |= {"contacts.stiffness": 1000.0, "contacts.damping": 10.0}
            found["controller.contact"] = True
        return overrides.write_options(found)


def trained() -> list[Case]:
    """The draws by which methods are chosen: of 5 cases for each of three linkages."""
    kinds = [("constant", False), ("profile", False), ("arm 100", False), ("arm 1000", False)]
    kinds += [("arm 300", True)]
    return list(_numbered(1, [(linkage, *kind) for linkage in TRAINED for kind in kinds]))


def kept_apart() -> list[Case]:
    """The draws that no choice has seen: of another linkage, another hand, and both."""
    kinds = [("constant", False), ("arm 300", False), ("profile", True)]
    found = [("slider-crank", *kind) for kind in kinds]
    found += [(each, "spring 200", False) for each in ("five-bar", "serial", "slider-crank")]
    return list(_numbered(101, found))


def at_rest(linkage: str) -> Case:
    """The draw around whose equilibrium the lifted map is taken."""
    return Case(linkage, AT_REST, False, 0)


def _numbered(first: int, kinds: list[tuple[str, str, bool]]) -> Iterator[Case]:
    for k, kind in enumerate(kinds):
        for seed in range(SEEDS):
            yield Case(*kind, first + STRIDE * k + seed)


def _hand(case: Case) -> dict[str, Any]:
    """The table [hand] of a case."""
    draw = np.random.Generator(np.random.PCG64(case.seed))
    kind, _, stiffness = case.hand.partition(" ")
    if kind == "constant":
        angle, turn = draw.uniform(-np.pi, np.pi), draw.uniform(-1.0, 1.0)
        force = [FORCE * np.cos(angle), FORCE * np.sin(angle), MOMENT * turn]
        return {"type": "constant", "wrench": [float(f) for f in force]}
    if kind == "profile":
        wrenches = draw.uniform(-1.0, 1.0, (5, 3)) * (FORCE, FORCE, MOMENT)
        table = [[0.75 * i, *map(float, w)] for i, w in enumerate(wrenches)]
        return {"type": "profile", "damping": [1.0, 1.0, 0.002], "table": table}
    k = float(stiffness)
    x, y, theta = LINKAGES[case.linkage]
    steps = (1.5 if case.contact else 1.0) * draw.uniform(-STEP, STEP, (6, 2))
    path = [[0.0, x, y, theta]]
    if case.seed:
        path += [[t / 2, x + dx, y + dy, theta] for t, (dx, dy) in enumerate(steps.tolist(), 1)]
    b = 1.4 * np.sqrt(k)  # a damping ratio of 0.7 with an arm of 1 kg
    hand = {"type": kind, "stiffness": [k, k, 0.0], "damping": [float(b), float(b), 0.01]}
    return {**hand, "target": path}
