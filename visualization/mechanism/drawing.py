"""A drawing of a scene's mechanism: paints the marks of `marks.py` with Matplotlib, in mm, and
writes the names of bodies and joints beside them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.scene.blocks import described_devices
from hapticlink.visualization.figure_axes import headline, plain
from hapticlink.visualization.mechanism import mark_places, workspace_drawing
from hapticlink.visualization.mechanism.mark_places import MM, Frame, Points, on_page, place
from hapticlink.visualization.mechanism.marks import (
    BODIES,
    Mark,
    Place,
    Point,
    attachment_points,
    full,
    outline,
    outline_bodies,
)
from hapticlink.visualization.mechanism.picture import Picture
from hapticlink.visualization.mechanism.view import PLANE_VIEW, View

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hapticlink.orchestrator.scene.scene import Scene

Coordinates = Sequence[float] | NDArray[np.float64]
"""Joint coordinates of a linkage (m, rad)."""
Look = dict[str, Any]
MAX_NAMED_BODIES = 10
"""Bodies of a linkage of which the names are written beside them."""
ROLES_BEHIND_PATHS = ("obstacle", "device", "directions", "ground", "rail", "spring")
"""Roles of marks that are drawn behind paths."""
CORNER, TRIAD = (0.08, 0.12), 34.0
"""Where the world's directions are drawn (parts of the drawing), and their length (pt)."""


def draw(
    axes: Axes,
    linkage: Linkage,
    q: Coordinates,
    end: Coordinates | None,
    contacts: Contacts | None = None,
    held: Device | None = None,
) -> Points:
    """The linkage at joint coordinates q, in mm; its pose at `end` as thin lines; what the links
    can touch, and where the device that holds it cannot reach. Returns the limits of x and y."""
    picture = Picture(linkage, {}, contacts)
    frame = picture.at_rest(q)
    if end is not None:
        at_end = {"end": picture.drawn({"q": end})["poses"]}
        outlines = outline_bodies(linkage, "end", "#8c8c8c", "the linkage at the end")
        paint(axes, outlines, at_end, zorder=2, view=picture.view)
    paint(axes, picture.marks, frame, view=picture.view)
    _names(axes, linkage, frame, picture.view)
    limits = _limits(axes)
    if held:
        workspace_drawing.beneath(axes, held, limits)
    if linkage.dimension > 2:
        _world_axes(axes, picture.view)
    else:
        axes.set(xlabel="x (mm)", ylabel="y (mm)")
    axes.set(xlim=limits[0], ylim=limits[1])
    axes.set_aspect("equal", adjustable="box")
    return limits


def _world_axes(axes: Axes, view: View) -> None:
    """The directions x, y and z in a corner, in place of the ticks."""
    for name, along in zip("xyz", on_page(np.eye(3), view), strict=True):
        axes.annotate(
            name, CORNER, TRIAD * along, "axes fraction", "offset points", color="0.4",
            ha="center", va="center", arrowprops={"arrowstyle": "<-", "color": "0.4"},
        )  # fmt: skip
    axes.set(xticks=[], yticks=[])


def device(
    axes: Axes,
    linkage: Linkage,
    q: Coordinates,
    devices: Mapping[str, Device],
    limits: Points,
) -> None:
    """The devices in whole where they start, with the linkage that they hold; a frame is the
    drawing within `limits` (mm)."""
    picture = Picture(linkage, devices, None)
    shown = (m for m in picture.marks if m.role in ("device", "body", "ground", "point"))
    paint(axes, shown, picture.at_rest(q), view=picture.view)
    (left, right), (low, high) = limits
    axes.plot([left, right, right, left, left], [low, low, high, high, low], "k:", lw=0.6)
    axes.set_aspect("equal", adjustable="box")
    axes.margins(0.06)
    axes.set(xticks=[], yticks=[])
    axes.set_xlabel("the whole device; dotted: the drawing", fontsize="x-small", color="0.3")
    for spine in axes.spines.values():
        spine.set_visible(False)


def figure(scene: Scene, q: Coordinates) -> Figure:
    """A figure of the scene's mechanism at joint coordinates q."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(6.4, 5.6), layout="constrained")
    axes = drawn.add_subplot()
    assert scene.linkage is not None
    devices = described_devices(scene)
    draw(axes, scene.linkage, q, None, scene.contacts, devices.get(""))
    picture = Picture(scene.linkage, devices, None)
    arms = (mark for mark in picture.marks if mark.role == "device")
    paint(axes, arms, picture.at_rest(q), view=picture.view)
    headline(axes, f"{scene.title} at the start", 70)
    axes.grid(alpha=0.3)
    drawn.legend(fontsize="x-small", ncols=3, loc="outside lower center")
    return drawn


def paint(
    axes: Axes,
    marks: Iterable[Mark],
    frame: Frame,
    zorder: float | None = None,
    view: View = PLANE_VIEW,
) -> None:
    """The marks that a frame has the places of."""
    labelled: set[str] = {""}
    for mark in mark_places.in_order(marks, frame, view):
        at = mark_places.points(mark, frame, view)
        if at is None:
            continue
        layer = (1.0 if mark.role in ROLES_BEHIND_PATHS else 3.0) if zorder is None else zorder
        look = {"zorder": layer, "label": None if mark.label in labelled else mark.label}
        if PAINTERS.get(mark.kind, _shape)(axes, mark, at, Seen(frame, view), look):
            labelled.add(mark.label)


class Seen(NamedTuple):
    """A frame and how it is seen."""

    frame: Frame
    view: View


def _area(axes: Axes, mark: Mark, at: Points, seen: Seen, look: Look) -> bool:
    from matplotlib.patches import Polygon

    if mark.fill is None:
        return _line(axes, mark, at, seen, look)
    axes.add_patch(Polygon(at, fc=mark.fill, ec=mark.stroke, lw=mark.width, **look))
    return True


def _line(axes: Axes, mark: Mark, at: Points, seen: Seen, look: Look) -> bool:
    # A line's dashes are multiples of its width.
    dash: Any = (0, [each / mark.width for each in mark.dash]) if mark.dash else "-"
    look = look | {"color": mark.stroke, "lw": mark.width, "ls": dash}
    axes.plot(*at.T, solid_capstyle="round", **look)
    return True


def _disc(axes: Axes, mark: Mark, at: Points, seen: Seen, look: Look) -> bool:
    from matplotlib.patches import Circle

    x, y = at[0]
    look = look | {"fc": mark.fill, "ec": mark.stroke, "lw": mark.width}
    axes.add_patch(Circle((x, y), mark.size * MM, **look))
    return True


def _shape(axes: Axes, mark: Mark, at: Points, seen: Seen, look: Look) -> bool:
    corners = mark_places.shape(mark, seen.frame)
    axes.plot(
        *at[0], marker=np.vstack([corners, corners[:1]]), ms=2 * np.abs(corners).max(), ls="",
        mfc=mark.fill or "none", mec=mark.stroke or "none", mew=mark.width, **look,
    )  # fmt: skip
    return True


def _arrow(axes: Axes, mark: Mark, at: Points, seen: Seen, look: Look) -> bool:
    tip: Any = mark_places.arrow(mark, *seen)
    if tip is None:
        return False
    line: Any = {"color": mark.stroke, "lw": mark.width}
    axes.annotate(
        "", at[0], tip, textcoords="offset points", annotation_clip=False, zorder=look["zorder"],
        arrowprops={"arrowstyle": "<|-", "shrinkA": 0, "shrinkB": 0} | line,
    )  # fmt: skip
    axes.plot([], [], **line, label=look["label"])
    return True


def _directions(axes: Axes, mark: Mark, at: Points, seen: Seen, look: Look) -> bool:
    size = float(np.ptp([axes.get_xlim(), axes.get_ylim()], axis=1).sum())
    ways = mark_places.vector(mark, *seen)
    for way in () if ways is None else ways:
        _line(axes, mark, at[0] + size * np.outer([-1, 1], way), seen, look)
        look = look | {"label": None}
    return True


PAINTERS = {
    "area": _area,
    "line": _line,
    "rail": _line,
    "spring": _line,
    "disc": _disc,
    "arrow": _arrow,
    "directions": _directions,
}
"""By kind of mark; all other kinds are SHAPES."""


def _limits(axes: Axes) -> Points:
    """Limits of x and y (mm) that contain what is drawn with a margin for names, (2, 2), in a ratio
    between 3/4 and 4/3; 100 mm about a single point."""
    limits = np.array([axes.dataLim.intervalx, axes.dataLim.intervaly])
    size = 1.3 * np.ptp(limits, axis=1)
    half = np.maximum(size, 0.75 * size.max() if size.max() > 1e-6 else 100.0) / 2
    return limits.mean(axis=1)[:, None] + half[:, None] * [-1.0, 1.0]


def _names(axes: Axes, linkage: Linkage, frame: Frame, view: View) -> None:
    """The names of bodies, and of joints, cut ones included, away from the middle of the mechanism;
    those of joints at one place are below each other."""
    if len(linkage.body) > MAX_NAMED_BODIES:
        return

    def seen(body: str, at: Point | None) -> Points:
        found = place(frame, Place(("poses", body), full(linkage, at)), view)
        assert found is not None
        return found

    corners = {
        body.name: outline(
            [seen(body.name, at) for at in attachment_points(linkage, body.name)]
            or [seen(body.name, None)]
        )
        for body in linkage.body
    }
    every = np.vstack([*corners.values()])
    middle = (every.min(axis=0) + every.max(axis=0)) / 2
    for i, (name, found) in enumerate(corners.items()):
        _name(axes, i, name, found, middle)
    named = [
        (j.name, j.child, j.at_child) if j.kind.slides else (j.name, j.parent, j.at_parent)
        for j in linkage.joint if j.kind.mark
    ]  # fmt: skip
    named += [(loop.name, loop.bodies[0], loop.at[0]) for loop in linkage.loop if loop.name]
    names: dict[tuple[float, ...], list[str]] = {}
    for name, body, at in named:
        names.setdefault(tuple(np.round(seen(body, at), 6)), []).append(name)
    for where, several in names.items():
        right, up = np.array(where) > middle
        offset = (7 if right else -7, 6 if up else -6)
        side = {"ha": "left" if right else "right", "va": "bottom" if up else "top"}
        _text(axes, where, "\n".join(several), offset, "0.3", **side)


def _name(axes: Axes, i: int, name: str, corners: Points, about: Points) -> None:
    """The name of the i-th body: on the inner side of a line, beside a single point."""
    from matplotlib.colors import to_rgb

    middle, inward = corners.mean(axis=0), np.array([0.0, 0.7])
    if len(corners) == 2:
        low, high = sorted(corners.tolist(), key=lambda corner: corner[1])
        x, y = np.subtract(high, low)
        if abs(y) > abs(x):  # neighbours have their names at different heights
            middle = np.array(low) + (0.6, 0.4)[i % 2] * np.array([x, y])
        inward = np.array([-y, x]) / np.hypot(x, y)
        inward = inward if inward @ (about - middle) > 0 else -inward
    elif len(corners) == 1:
        right, up = middle > about
        inward = np.array([0.8 if right else -0.8, -0.6 if up else 0.6])
    side = "left" if inward[0] > 0.3 else "right" if inward[0] < -0.3 else "center"
    dark = tuple(0.65 * part for part in to_rgb(BODIES[i % len(BODIES)]))
    _text(axes, middle, name, (12 * inward[0], 12 * inward[1]), dark, ha=side, va="center")


def _text(
    axes: Axes, at: Any, text: str, offset: tuple[float, float], color: Any, **how: Any
) -> None:
    halo: dict[str, Any] = {"boxstyle": "round,pad=0.1", "fc": "w", "ec": "none", "alpha": 0.7}
    axes.annotate(
        plain(text), tuple(at), xytext=offset, textcoords="offset points", fontsize="small",
        color=color, zorder=8, bbox=halo, **how,
    )  # fmt: skip
