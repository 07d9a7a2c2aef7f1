"""Closed loops in continuous time, each integrated twice: the reference of a co-simulation.

What a co-simulation approaches as its rates grow: plants, hand and controller at the same instant,
Lambda^-1, P_c and the places of contacts at the mechanism's own pose, no held value. Scenes with
`sensing = "encoders"` have no such limit: counts of an encoder do not vanish as rates grow.

`relative` takes the components' own expressions in joint coordinates, by DOP853 (order 8, explicit,
Hairer, Norsett and Wanner 1993); `absolute` is written by hand in absolute coordinates, by LSODA
(Adams methods of variable order, Hindmarsh 1983). They share the scene's numbers and the assembled
start. The largest difference of their handles is the floor: smaller errors mean nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.rows import Rows
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.scene import Scene

GRID = 128
"""Rate (Hz) of the grid on which handles are compared; it divides all haptic rates."""
CONTINUOUS = "directions_from=mechanism"
DETECTED = "contacts.detection=haptics"
COLUMNS = ("scene", "t", "x_relative", "y_relative", "x_absolute", "y_absolute")


@dataclass(frozen=True)
class Reference:
    """The handle's path (k, 2) in m at t = 0, 1/GRID, ..., by both integrations."""

    relative: np.ndarray
    absolute: np.ndarray

    @property
    def floor(self) -> float:
        """Largest distance (m) of the two."""
        return float(np.linalg.norm(self.relative - self.absolute, axis=1).max())


def scene(name: str) -> Scene:
    """The scene, with nothing from the graphics copy."""
    found = open_scene.load(name, [CONTINUOUS])
    return open_scene.load(name, [CONTINUOUS, DETECTED]) if found.contacts else found


def reference(name: str, end: float = 3.0, tolerance: float = 1e-12) -> Reference:
    """The handle of a scene until `end` (s), a multiple of 1/GRID; `tolerance` is relative, and m
    or rad over a hundred."""
    from benchmarks.continuous.absolute import Absolute
    from benchmarks.continuous.march import march
    from benchmarks.continuous.relative import Relative

    found, grid = scene(name), np.arange(round(end * GRID) + 1) / GRID
    first = Relative(found)
    assert found.linkage
    n = len(found.linkage.joint)
    second = Absolute(found, first.start[:n], first.start[n : 2 * n], first.first_mode)
    sizes = {"rtol": tolerance, "atol": tolerance / 100}
    return Reference(
        march(first, grid, method="DOP853", **sizes)[0],
        march(second, grid, method="LSODA", **sizes)[0],
    )


def kept(path: Path, name: str) -> Reference:
    """The reference of a scene, from the CSV file `path`, or computed and appended to it."""
    rows = Rows(path, COLUMNS, keys=2)
    if (name, 0.0) not in rows:
        made = reference(name)
        for k, (a, b) in enumerate(zip(made.relative, made.absolute, strict=True)):
            rows.add(name, k / GRID, *a.tolist(), *b.tolist())
    mine = [row for row in rows.rows.values() if row["scene"] == name]
    values = np.array([[float(row[c]) for c in COLUMNS[2:]] for row in mine])
    return Reference(values[:, :2], values[:, 2:])
