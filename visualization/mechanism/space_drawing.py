"""A linkage in space, drawn by parallel projection: turned a little about the vertical and seen
from above. Up is against gravity, z without it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.linkage.poses import place_function
from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import Place
from hapticlink.visualization.curve_colours import CURVES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Matrix = NDArray[np.float64]
TURNED, ABOVE = -0.6, 0.35
"""Angles (rad) by which the view is turned about the vertical, and looks down."""
CORNER, TRIAD = (0.08, 0.12), 34.0
"""Where the world's axes are drawn (parts of the drawing), and their length (pt)."""


def draw(axes: Axes, linkage: Linkage, q: Matrix, end: Matrix, path: Matrix) -> None:
    """The linkage at joint coordinates q, at `end` as thin lines, and the path of its operational
    point, (k, 3) in m."""
    view = projection(linkage)
    for at, width in ((end, 1.0), (q, 4.0)):
        for i, (body, points) in enumerate(strokes(linkage, at).items()):
            look: dict[str, Any] = {"linewidth": width, "markersize": width}
            look["color"] = CURVES[i % len(CURVES)]
            axes.plot(*view(points), "o-", label=body if at is q else "", **look)
        for points in rods(linkage, at):
            axes.plot(*view(points), "-", color="0.5", linewidth=width / 2)
    axes.plot(*view(on_ground(linkage, q)), "^", color="0.5", markersize=7)
    axes.plot(*view(path), "--", color="0.3", linewidth=1, label="path of the point")
    for name, along in zip("xyz", view(np.eye(3)).T, strict=True):
        axes.annotate(
            name, CORNER, TRIAD * along / 1e3, "axes fraction", "offset points", color="0.4",
            ha="center", va="center", arrowprops={"arrowstyle": "<-", "color": "0.4"},
        )  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xticks=[], yticks=[])
    axes.legend(fontsize="small")


def projection(linkage: Linkage) -> Callable[[Matrix], Matrix]:
    """(k, 3) in m -> (2, k) in mm, to the right and up."""
    weight = np.array((*(linkage.gravity or (0.0, 0.0)), 0.0)[:3])
    up = -weight / np.linalg.norm(weight) if weight.any() else np.array([0.0, 0.0, 1.0])
    aside = np.roll(np.eye(3)[np.abs(up).argmax()], 1)
    aside = aside - up * (up @ aside)
    aside /= np.linalg.norm(aside)
    deep = np.cross(up, aside)
    right = np.cos(TURNED) * aside + np.sin(TURNED) * deep
    away = np.cos(TURNED) * deep - np.sin(TURNED) * aside
    onto = 1e3 * np.array([right, np.cos(ABOVE) * up + np.sin(ABOVE) * away])
    return lambda points: onto @ np.atleast_2d(points).T


def strokes(linkage: Linkage, q: Matrix) -> dict[str, Matrix]:
    """By body, a line from the joint that carries it to each other joint and to the operational
    point on it, and back; to the centre of mass where there is none."""
    found = {}
    for body in linkage.body:
        ends = [j.at_child for j in linkage.joint if j.child == body.name]
        ends += _attached(linkage, body.name)
        ends += [linkage.held.at] if linkage.held.body == body.name else []
        ends += [body.center] if len(ends) < 2 else []
        first, *others = _world(linkage, [(body.name, at) for at in ends], q)
        found[body.name] = np.array([point for other in others for point in (first, other)])
    return found


def rods(linkage: Linkage, q: Matrix) -> list[Matrix]:
    """The ends of each rod that is a closure, (2, 3)."""
    pairs = [zip(o.bodies, o.at, strict=True) for o in linkage.loop if "distance" in o.kind.holds]
    return [_world(linkage, [*pair], q) for pair in pairs]


def on_ground(linkage: Linkage, q: Matrix) -> Matrix:
    """The joints on the ground, (k, 3)."""
    return _world(linkage, [("ground", at) for at in _attached(linkage, "ground")], q)


def _attached(linkage: Linkage, body: str) -> list[Place | None]:
    """The points of a body at which it carries others, and at which loops are cut."""
    carried = [j.at_parent for j in linkage.joint if j.parent == body]
    cut = (zip(loop.bodies, loop.at, strict=True) for loop in linkage.loop)
    return [*carried, *(at for pair in cut for name, at in pair if name == body)]


def _world(linkage: Linkage, places: Sequence[tuple[str, Place | None]], q: Matrix) -> Matrix:
    return np.array(place_function(linkage, places)(q)).T
