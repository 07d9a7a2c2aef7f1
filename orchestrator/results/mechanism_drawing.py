"""A drawing of a scene's mechanism: bodies, joints, operational points, walls and the device."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.linkage.poses import poses
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.linkage import Body, Joint, Linkage, Loop
from hapticlink.orchestrator.results import workspace
from hapticlink.orchestrator.results.figure_axes import plain
from hapticlink.orchestrator.results.mechanism_geometry import (
    BODIES,
    attached,
    contact_shape,
    outline,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hapticlink.orchestrator.scene.scene import Scene

Pose = NDArray[np.float64]
NAMED = 10
"""Number of bodies up to which names are written beside them."""
MM = 1e3
RED = "#cc3311"


def draw(
    axes: Axes,
    linkage: Linkage,
    q: Sequence[float],
    end: Sequence[float] | None = None,
    device: Device | None = None,
    contacts: Contacts | None = None,
) -> None:
    """The linkage at joint coordinates q, in mm; its pose at `end` as thin lines; what the links
    can touch; the arms of the device, its handle at the operational point, and the border of its
    workspace, as far as they reach into the picture."""
    drawing = _Drawing(axes, linkage, poses(linkage, [q]))
    if contacts:
        obstacles(axes, contacts)
    if end is not None:
        _Drawing(axes, linkage, poses(linkage, [end])).outlines()
    drawing.bodies()
    drawing.joints()
    drawing.springs()
    drawing.points()
    limits = _limits(axes)
    if device:
        workspace.beneath(axes, device, drawing.operational_pose(), limits)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", xlim=limits[0], ylim=limits[1])
    axes.set_aspect("equal", adjustable="box")


def pose(axes: Axes, linkage: Linkage, at: dict[str, Pose]) -> None:
    """Bodies, joints, springs and points that hands hold, in mm, without names, for poses (1, 3)
    of the bodies by name."""
    drawing = _Drawing(axes, linkage, at, names=False)
    drawing.bodies()
    drawing.joints()
    drawing.springs()
    drawing.points()


def _limits(axes: Axes) -> Pose:
    """Limits of x and y (mm) that contain what is drawn with a margin for names, (2, 2), in a ratio
    between 3/4 and 4/3; 100 mm about a single point."""
    found = np.array([axes.dataLim.intervalx, axes.dataLim.intervaly])
    size = 1.3 * np.ptp(found, axis=1)
    half = np.maximum(size, 0.75 * size.max() if size.max() > 1e-6 else 100.0) / 2
    return found.mean(axis=1)[:, None] + half[:, None] * [-1.0, 1.0]


def figure(scene: Scene, q: Sequence[float]) -> Figure:
    """A figure of the scene's mechanism at joint coordinates q."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(6.4, 5.6), layout="constrained")
    FigureCanvasAgg(drawn)
    axes = drawn.add_subplot()
    assert scene.linkage is not None
    draw(axes, scene.linkage, q, None, scene.device, scene.contacts)
    axes.set_title(plain(fill(f"{scene.title} at the start", 70)), fontsize="medium")
    axes.grid(alpha=0.3)
    drawn.legend(fontsize="x-small", ncols=3, loc="outside lower center")
    return drawn


class _Drawing:
    """One pose of a linkage."""

    def __init__(
        self, axes: Axes, linkage: Linkage, at: dict[str, Pose], names: bool = True
    ) -> None:
        self.axes, self.linkage = axes, linkage
        self._at = {name: found[0] for name, found in at.items()}
        self._names = names and len(linkage.body) <= NAMED

    def _world(self, body: str, point: Sequence[float] | None) -> Pose:
        """The place (mm) of a point of a body."""
        x, y, angle = self._at[body]
        c, s = np.cos(angle), np.sin(angle)
        px, py = point or (0.0, 0.0)
        return np.array([x + c * px - s * py, y + s * px + c * py]) * MM

    def _attached(self, body: str) -> Iterator[Pose]:
        """What a body holds together (mm), and the pins that slide in it."""
        yield from (self._world(body, at) for at in attached(self.linkage, body))
        for loop in self.linkage.loop:
            if loop.type != "revolute" and loop.bodies[1] == body:
                yield self._world(loop.bodies[0], loop.at[0])

    def _outline(self, body: Body) -> Pose:
        """As of mechanism_geometry, with the pins that slide in the body."""
        return outline([*self._attached(body.name)])

    def _shape(self, body: Body) -> Pose:
        """The outline (mm) of what a body touches with."""
        return np.array([self._world(body.name, at) for at in contact_shape(body).tolist()])

    def outlines(self) -> None:
        """The bodies as thin lines."""
        for i, body in enumerate(self.linkage.body):
            corners = self._outline(body)
            if len(corners) == 1 and body.shape:
                corners = self._shape(body)
            closed = np.vstack([corners, corners[:1]])
            label = "at the end" if i == 0 else None
            self.axes.plot(*closed.T, color="0.55", lw=1.0, ls="--", zorder=2, label=label)

    def bodies(self) -> None:
        """Each body with its name, centre of mass and, where it has one, shape for contacts."""
        from matplotlib.patches import Polygon

        for i, body in enumerate(self.linkage.body):
            color = BODIES[i % len(BODIES)]
            corners = self._outline(body)
            if len(corners) > 2:
                self.axes.add_patch(
                    Polygon(corners, fc=(*_rgb(color), 0.25), ec=color, lw=2.5, zorder=3)
                )
            else:
                self.axes.plot(*corners.T, color=color, lw=5, solid_capstyle="round", zorder=3)
                if len(corners) == 1 and not body.shape:
                    self.axes.plot(*corners.T, "s", color=color, ms=14, alpha=0.5, zorder=3)
            if body.shape:
                filled = (*_rgb(color), 0.25)
                self.axes.add_patch(
                    Polygon(self._shape(body), fc=filled, ec=color, lw=0.8, zorder=3)
                )
            center = self._world(body.name, body.center)
            mark = "centre of mass" if i == 0 else None
            self.axes.plot(*center, "k+", ms=6, mew=1.2, zorder=6, ls="", label=mark)
            if self._names:
                self._name(i, body.name, corners, color)

    def joints(self) -> None:
        """Revolute joints as circles, prismatic ones as sliders on their axis; closures are
        filled. Joints at one place have their names below each other."""
        names: dict[tuple[float, ...], list[str]] = {}
        for joint in self.linkage.joint:
            if joint.type == "free":
                continue
            place = self._world(joint.parent, joint.at_parent)
            if joint.type == "prismatic":
                place = self._slider(joint, place)
            else:
                self._circle(place, "w")
            self._ground(joint.parent, place)
            names.setdefault(tuple(np.round(place, 6)), []).append(joint.name)
        for loop in self.linkage.loop:
            place = self._world(loop.bodies[0], loop.at[0])
            if loop.type != "revolute":
                self._slot(loop, place)
            self._circle(place, "k")
            if "ground" in loop.bodies:
                self._ground("ground", place)
        middle = self._extent().mean(axis=0)
        for at, several in names.items() if self._names else ():
            right, up = at[0] > middle[0], at[1] > middle[1]
            offset = (7 if right else -7, 6 if up else -6)  # away from the mechanism
            where = {"ha": "left" if right else "right", "va": "bottom" if up else "top"}
            self._text(at, "\n".join(several), offset, "0.3", **where)
        if self.linkage.loop:
            self.axes.plot([], [], "ko", ms=6, label="joint that closes a loop")

    def _circle(self, place: Pose, fill: str) -> None:
        self.axes.plot(*place, "o", mfc=fill, mec="k", ms=6, mew=1.2, zorder=5)

    def _ground(self, body: str, place: Pose) -> None:
        if body == "ground":
            self.axes.plot(*place, marker=(3, 0, 0), color="0.55", ms=17, zorder=1)

    def _slider(self, joint: Joint, place: Pose) -> Pose:
        """The place of the slider; its axis is drawn through it."""
        child = self._world(joint.child, joint.at_child)
        angle = self._at[joint.parent][2] + (joint.axis or 0.0)
        along = np.array([np.cos(angle), np.sin(angle)])
        reach = max(float(np.linalg.norm(child - place)), 0.15 * self._size())
        ends = np.array([place - 0.3 * reach * along, place + 1.3 * reach * along])
        if np.dot(child - place, along) < 0:
            ends = 2 * place - ends
        self.axes.plot(*ends.T, color="0.4", lw=1, ls="-.", zorder=1)
        turned = (4, 0, np.degrees(angle) + 45)
        self.axes.plot(*child, marker=turned, mfc="w", mec="k", ms=12, mew=1.2, zorder=4)
        return child

    def _slot(self, loop: Loop, pin: Pose) -> None:
        """The line in which a pin slides, from its point on the body to beyond the pin."""
        angle = self._at[loop.bodies[1]][2] + (loop.axis or 0.0)
        along = np.array([np.cos(angle), np.sin(angle)]) * 0.15 * self._size()
        ends = np.array([self._world(loop.bodies[1], loop.at[1]), pin])
        ends = ends[np.argsort(ends @ along)] + np.array([-along, along])
        self.axes.plot(*ends.T, color="0.4", lw=1, ls="-.", zorder=1)

    def _size(self) -> float:
        """The larger side of `_extent` (mm)."""
        return float(np.ptp(self._extent(), axis=0).max()) or 100.0

    def _extent(self) -> Pose:
        """The least and the largest x and y (mm) of all joints and points, (2, 2)."""
        found = np.array([p for b in self.linkage.body for p in self._attached(b.name)])
        return np.array([found.min(axis=0), found.max(axis=0)])

    def springs(self) -> None:
        """Springs and dampers between points of bodies."""
        for i, spring in enumerate(self.linkage.spring):
            ends = [self._world(b, at) for b, at in zip(spring.bodies, spring.at, strict=True)]
            label = "spring or damper" if i == 0 else None
            self.axes.plot(*_zigzag(*ends).T, color="0.3", lw=1.0, zorder=2, label=label)

    def points(self) -> None:
        """The points that hands hold."""
        held = self.linkage.operational_point
        marks = [(held, "X", "operational point")]
        marks += [(point, "P", f"point {point.name}") for point in self.linkage.point]
        for point, mark, label in marks:
            place = self._world(point.body, point.at)
            self.axes.plot(*place, mark, color=RED, ms=9, zorder=7, ls="", label=label)

    def operational_pose(self) -> Pose:
        """Of the operational point: x m, y m, theta rad."""
        held = self.linkage.operational_point
        return np.array([*(self._world(held.body, held.at) / MM), self._at[held.body][2]])

    def _name(self, i: int, name: str, corners: Pose, color: str) -> None:
        """The name of the i-th body: on the inner side of a line, beside a single point."""
        middle, inward = corners.mean(axis=0), np.array([0.0, 0.7])
        if len(corners) == 2:
            low, high = sorted(corners.tolist(), key=lambda corner: corner[1])
            x, y = np.subtract(high, low)
            if abs(y) > abs(x):  # neighbours have their names at different heights
                middle = np.array(low) + (0.6, 0.4)[i % 2] * np.array([x, y])
            inward = np.array([-y, x]) / np.hypot(x, y)
            inward = inward if inward @ (self._extent().mean(axis=0) - middle) > 0 else -inward
        elif len(corners) == 1:
            right, up = middle > self._extent().mean(axis=0)
            inward = np.array([0.8 if right else -0.8, -0.6 if up else 0.6])
        side = "left" if inward[0] > 0.3 else "right" if inward[0] < -0.3 else "center"
        dark = tuple(0.65 * part for part in _rgb(color))
        offset = (12 * inward[0], 12 * inward[1])
        self._text(middle, name, offset, dark, ha=side, va="center")

    def _text(
        self,
        place: Sequence[float] | Pose,
        text: str,
        offset: tuple[float, float],
        color: str | tuple[float, ...],
        **how: Any,
    ) -> None:
        halo: dict[str, Any] = {"boxstyle": "round,pad=0.1", "fc": "w", "ec": "none", "alpha": 0.7}
        self.axes.annotate(
            plain(text), tuple(place), xytext=offset, textcoords="offset points", fontsize="small",
            color=color, zorder=8, bbox=halo, **how,
        )  # fmt: skip


def obstacles(axes: Axes, contacts: Contacts) -> None:
    """Enclosure and obstacles, in mm."""
    from matplotlib.patches import Circle, Patch, Polygon

    look: dict[str, Any] = {"facecolor": "0.85", "edgecolor": "0.4"}
    found: list[Patch] = [
        Circle((d.center[0] * MM, d.center[1] * MM), d.radius * MM, **look) for d in contacts.disc
    ]
    found += [Polygon(np.array(p.corners) * MM, **look) for p in contacts.polygon]
    if found:
        found[0].set_label("obstacles")
    if contacts.enclosure:
        walls = np.array(contacts.enclosure) * MM
        found.append(Polygon(walls, fill=False, edgecolor="0.4", label="enclosure"))
    for patch in found:
        axes.add_patch(patch)


def _rgb(color: str) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb(color)


def _zigzag(a: Pose, b: Pose) -> Pose:
    """A spring's line from a to b."""
    along = b - a
    length = float(np.linalg.norm(along)) or 1.0
    across = np.array([-along[1], along[0]]) / length * min(0.04 * length, 6.0)
    share = np.linspace(0.2, 0.8, 13)
    waves = np.where(np.arange(13) % 2, 1.0, -1.0)[:, None] * across
    return np.vstack([a, a + share[:, None] * along + waves, b])
