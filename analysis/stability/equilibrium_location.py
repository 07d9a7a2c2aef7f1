"""Where a scene is judged: at which pose, with what in contact, and whether the run from the
scene's start comes to rest there."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticlink.analysis.stability.lifted_map import LiftedMap
from hapticlink.analysis.stability.linearisation import Linearisation
from hapticlink.analysis.stability.trajectory import TOLERANCE, Trajectory, relative
from hapticlink.components.contact.depth import depths
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.loop_names import MECHANISM
from hapticlink.orchestrator.scene.scene import Scene

THERE = 1e-3
"""Distance of a state and input of an FMU, relative to max(1, |z|), within which a run is there."""
FALLING = 0.9
"""Of the distance in the third quarter of a run, below which that in the last still falls."""


@dataclass(frozen=True)
class Gap:
    """How far two states are apart: at the operational point (m, rad), or in the coordinate of an
    FMU in which they differ most, relative to max(1, |z|)."""

    by: dict[str, float]

    def __str__(self) -> str:
        if "m" in self.by:
            turned = f" and {self.by['rad']:.2g} rad" if self.by["rad"] else ""
            return f"{1e3 * self.by['m']:.3g} mm{turned}"
        return ", ".join(f"{value:.3g} in {name}" for name, value in self.by.items())


@dataclass(frozen=True)
class EquilibriumLocation:
    """Where an equilibrium is, and whether the run from the start comes there."""

    pose: tuple[float, ...]
    """x, y (m) and theta (rad) of the operational point, () without one."""
    from_start: Gap
    """Its distance from the start of the scene."""
    contacts: dict[str, float]
    """Depths (m) of what presses, by body and obstacle."""
    run: str
    """What the run does: "rests there", "approaches", "rests elsewhere" or "passes"."""
    time: float
    """The time (s) from which on the run is there, or at which it is nearest: by its operational
    point, if it passes."""
    nearest: Gap
    """The distance at that time."""
    end: float
    """The end (s) of the run."""
    at_end: Gap
    """The distance at the end."""
    ended: str
    """What ended the run before its time."""

    def record(self) -> dict[str, Any]:
        """The entry `where` of stability.json."""
        return {
            "operational_point": list(self.pose),
            "distance_from_start": self.from_start.by,
            "contacts": self.contacts,
            "run": self.run,
            "time": self.time,
            "distance_then": self.nearest.by,
            "end_of_run": self.end,
            "distance_at_end": self.at_end.by,
            "run_failed": self.ended,
        }

    def lines(self) -> Iterator[str]:
        """One line on the place, one on the run."""
        place = "at an equilibrium"
        if self.pose:
            x, y, theta = self.pose
            place = f"at x {1e3 * x:.4g} mm, y {1e3 * y:.4g} mm, theta {theta:.4g} rad"
        line = f"judged {place}, {self.from_start} from the start"
        if self.contacts:
            pressing = (f"{who} ({1e3 * depth:.2g} mm)" for who, depth in self.contacts.items())
            line += f", in contact: {', '.join(pressing)}"
        yield line
        fails = f", where the map ends: {self.ended}" if self.ended else ""
        if self.run == "rests there":
            yield f"the run from the start comes to rest there, from {self.time:.4g} s on"
        elif self.run == "approaches":
            yield (
                f"the run from the start nears it, but has not come to rest at its end, "
                f"{self.end:.4g} s, {self.at_end} away{fails}"
            )
        elif self.run == "rests elsewhere":
            yield (
                f"the run from the start comes to rest elsewhere, {self.at_end} away, at "
                f"{self.end:.4g} s"
            )
        else:
            yield (
                f"the run from the start has not come to rest there: it is nearest at "
                f"{self.time:.4g} s, {self.nearest} away, and {self.at_end} away at its end, "
                f"{self.end:.4g} s{fails}"
            )


def location(
    scene: Scene, map_: LiftedMap, linear: Linearisation, run: Trajectory
) -> EquilibriumLocation:
    """Where the equilibrium of the map is, and whether the run from the start comes there."""
    away = run.distances(linear.point)
    there, nearest = away <= THERE, int(np.argmin(away))
    (first, last), (third, fourth) = _halves(away), _halves(away[len(away) // 2 :])
    if there[-1] and (run.rests or last <= max(first, TOLERANCE)):
        kind, nearest = "rests there", int(np.append(-1, np.flatnonzero(~there))[-1]) + 1
    elif run.rests:
        kind = "rests elsewhere"
    else:
        kind = "approaches" if last < first / 2 and fourth < FALLING * third else "passes"
    places = _places(map_, "x")[:3]
    if kind == "passes" and len(places) == 3:
        nearest = int(np.argmin(np.hypot(*(run.states - linear.image)[:, places[:2]].T)))

    def gap(state: Vector) -> Gap:  # FMUs come first in a state
        if len(places) == 3:
            x, y, theta = (state[places] - linear.image[places]).tolist()
            return Gap({"m": math.hypot(x, y), "rad": abs(theta)})
        z = linear.point[run.moving]
        apart = relative(state[run.moving] - z, z)
        j = int(np.argmax(apart))
        return Gap({str(map_.coordinates[run.moving[j]]): float(apart[j])})

    return EquilibriumLocation(
        pose=tuple(linear.image[places].tolist()) if len(places) == 3 else (),
        from_start=gap(map_.initial),
        contacts=_pressing(scene, linear.image[_places(map_, "q")]),
        run=kind,
        time=float(run.times[nearest]),
        nearest=gap(run.states[nearest]),
        end=float(run.times[-1]),
        at_end=gap(run.states[-1]),
        ended=run.ended,
    )


def _halves(away: Vector) -> tuple[float, float]:
    """The largest distance in the first and in the second half of a run."""
    return float(away[: len(away) // 2 + 1].max()), float(away[len(away) // 2 :].max())


def _places(map_: LiftedMap, port: str) -> list[int]:
    """The coordinates of an output of the mechanism, as its FMU keeps it."""
    return [
        i
        for i, c in enumerate(map_.coordinates)
        if c.inert and (c.owner, c.variable.partition("[")[0]) == (MECHANISM, port)
    ]


def _pressing(scene: Scene, q: Vector) -> dict[str, float]:
    if not scene.linkage or not scene.contacts or not len(q):
        return {}
    found = depths(scene.linkage, scene.contacts, q)
    return {f"{p.body} on {p.obstacle}": float(d[0]) for p, d in found if d[0] > 0.0}
