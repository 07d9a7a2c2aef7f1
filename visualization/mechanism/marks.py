"""A drawing of a mechanism as a list of marks: what is drawn where, in which order and how.

It is the one description of figures, live page, replays and animations. Their painters,
`drawing.py` and `browser_code/painter.js`, know lines and colours, but no linkage.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.episodes import EPISODES
from hapticlink.components.device.workspace import drawn_lines
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.linkage import Body, Joint, Linkage

Point = Sequence[float]
Points = NDArray[np.float64]
"""Points, (k, 2) in the plane and (k, 3) in space."""
Path = tuple[str | int, ...]
"""Keys, one within the other, of a pose (x m, y m, theta rad), point or vector in a frame."""
Corners = list[list[float]]
ORIGIN = (0.0, 0.0)
Z = (0.0, 0.0, 1.0)
STILL = {"poses": {"ground": (0.0, 0.0, 0.0)}}
"""A frame of what does not move."""
BODIES = ("#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677", "#aa3377")
"""The bright scheme of P. Tol, which colour-blind readers can tell apart."""
COLOURS = {
    "folded": "#cc3311",
    "saturated": "#ee7733",
    "energy": "#ddaa00",
    "constraints": "#aa3377",
    "contacts": "#4477aa",
    "outside": "#777777",
}
KINDS = {kind: (COLOURS[kind], meaning) for kind, meaning in EPISODES.items()}
"""Colour and meaning of what can happen in a run."""
INK, GREY, RED = "#000000", "#666666", "#cc3311"
FORCES = {
    "F_hand": ("hand", "#b85c00", "handle"),
    "F_constraint": ("topology controller", "#aa3377", "handle"),
    "F_env": ("contacts and others", RED, "x"),
}
"""By name in a frame: meaning and colour of a user's force, and where it acts."""
PER_NEWTON = 16.5
"""Length (pt) of an arrow to a newton."""
BEYOND = 0.15
"""Of the longest body, by which the line along which something slides goes on at its ends."""
ROUND = np.exp(2j * np.pi * np.arange(48) / 48)
"""Corners of a circle of radius 1."""


def _polygon(corners: Any) -> Corners:
    return np.column_stack([corners.real, corners.imag]).tolist()


def _plus(size: float, wide: float) -> NDArray[np.complex128]:
    quarter = np.array([size + wide * 1j, wide + wide * 1j, wide + size * 1j]) / 2
    return np.concatenate([quarter * turn for turn in (1, 1j, -1, -1j)])


_EIGHTH = np.exp(0.25j * np.pi)
SHAPES = {
    "pin": _polygon(3.0 * ROUND),
    "ring": _polygon(6.75 * ROUND),
    "ground": _polygon(8.5 * np.exp(2j * np.pi * np.array([0.25, 0.583, 0.917]))),
    "square": _polygon(14 / np.sqrt(2) * _EIGHTH * np.array([1, 1j, -1, -1j])),
    "slider": _polygon(6.0 * _EIGHTH * np.array([1, 1j, -1, -1j])),
    "centre": _polygon(_plus(6.0, 0.0)),
    "point": _polygon(_plus(9.0, 3.0)),
    "operational point": _polygon(1.2 * _EIGHTH * _plus(9.0, 3.0)),
}
"""Corners (pt) of marks that have one size on the screen."""


class Place(NamedTuple):
    """A point (m) in the frame of what is at `path` in a frame of the drawing; nothing is drawn
    there while it is not in the frame. What is in space has points of three numbers."""

    path: Path
    point: Point = ORIGIN


class Mark(NamedTuple):
    """`kind`: line, area, spring, disc of radius `size` (m), rail through two places, beyond both
    by the way from the second to a third one, shape of SHAPES, arrow of `size` (pt) to a newton or
    directions of the `vector`; `angle` (rad) of a shape in the frame of the last place, None where
    it does not turn. `when`: in which state alone it is drawn. Widths and dashes are in points."""

    role: str
    kind: str
    at: tuple[Place, ...]
    stroke: str | None = INK
    fill: str | None = None
    width: float = 1.2
    dash: tuple[float, ...] = ()
    label: str = ""
    when: str = ""
    size: float = 0.0
    angle: float | None = None
    vector: Path = ()


def marks(
    linkage: Linkage, contacts: Contacts | None = None, devices: Mapping[str, Device] | None = None
) -> list[Mark]:
    """All that frames of a linkage can show, from back to front; devices: of the users who have
    one, by their points, the first one's name is empty."""
    devices = devices or {}
    users = ["", *(point.name for point in linkage.point)]
    users = [user for user in users if not user or user in [*devices]]
    drawn = [
        *obstacles(contacts),
        *(mark for user, device in devices.items() for mark in _arms(user, device)),
        *(_directions(user) for user in users),
        *_slides(linkage),
        *_springs(linkage),
        *(m for i, b in enumerate(linkage.body) for m in _body(linkage, b, BODIES[i % 6])),
        *_rods(linkage),
        *outline_bodies(linkage, "ghost", "#333333aa", "graphics copy"),
        *outline_bodies(linkage, "ghost", KINDS["folded"][0], when="folded"),
        *_joints(linkage),
        *_points(linkage),
        *(mark for user in users for mark in _handle(user)),
        *_forces(linkage, users),
    ]
    return [*_lifted(drawn, linkage)]


def _lifted(drawn: Iterable[Mark], linkage: Linkage) -> Iterator[Mark]:
    """The marks with points of as many numbers as the linkage has directions."""
    for mark in drawn:
        at = (place._replace(point=full(linkage, place.point)) for place in mark.at)
        yield mark._replace(at=(*at,))


def full(linkage: Linkage, point: Point | None) -> tuple[float, ...]:
    """A point of a body, by default its origin, with z = 0 where it has none in space."""
    return (*(point or ORIGIN), 0.0)[: linkage.dimension]


def outline_bodies(
    linkage: Linkage, key: str, stroke: str, label: str = "", when: str = ""
) -> Iterator[Mark]:
    """The bodies as thin lines, at the poses at `key` of a frame."""
    if linkage.dimension > 2:
        thin = Mark("ghost", "line", (), stroke, width=1.0, dash=(3.7, 1.6), when=when)
        for body in linkage.body:
            for at in _strokes(linkage, body, key):
                yield thin._replace(at=at, label=label)
                label = ""
        return
    for i, body in enumerate(linkage.body):
        at = _corners(linkage, body, key)
        if len(at) == 1 and body.shape:
            at = (*(Place((key, body.name), p) for p in contact_shape(body).tolist()),)
        said, kind = "" if i else label, "area" if len(at) > 2 else "line"
        yield Mark("ghost", kind, at, stroke, width=1.0, dash=(3.7, 1.6), label=said, when=when)


def attachment_points(linkage: Linkage, body: str) -> Iterator[Point]:
    """The points at which a body has its joints, closures and operational points."""
    for joint in linkage.joint:
        if joint.child == body:
            yield joint.at_child or ORIGIN
        if joint.parent == body and joint.kind.mark:
            yield joint.at_parent or ORIGIN
    for loop in linkage.loop:
        yield from (
            at or ORIGIN for name, at in zip(loop.bodies, loop.at, strict=True) if name == body
        )
    for point in (linkage.held, *linkage.points.values(), *linkage.point):
        if point.body == body:
            yield point.at or ORIGIN


def outline(points: Sequence[Point | Points] | Points) -> Points:
    """The corners of the convex hull of points, (k, 2): two for points on a line, one for a single
    point."""
    corners = np.unique(np.round(np.array(points, float), 9), axis=0)
    if len(corners) <= 2:
        return corners
    _, sizes, (direction, _) = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)
    if sizes[1] > 1e-6 * sizes[0]:
        return _hull(corners)
    along = corners @ direction
    return corners[[along.argmin(), along.argmax()]]


def contact_shape(body: Body) -> Points:
    """The outline of what a body touches with, (k, 2): the hull of discs at its corners."""
    disc = np.column_stack([ROUND.real, ROUND.imag]) * (body.radius or 0.0)
    return outline(np.vstack([at + disc for at in np.array(body.shape)]))


def point_of(linkage: Linkage, user: str) -> Place:
    """The point that a user holds."""
    held = [p for p in linkage.point if p.name == user] if user else [linkage.held]
    return _on(held[0].body, held[0].at)


def _on(body: str, at: Point | None) -> Place:
    return Place(("poses", body), at or ORIGIN)


def _of(user: str) -> Path:
    return ("others", user) if user else ()


def state(kind: str, user: str) -> str:
    """What a kind of KINDS is called of a user."""
    return f"{kind} {user}".strip()


def _outline(linkage: Linkage, body: Body) -> Points:
    return outline([*attachment_points(linkage, body.name)] or [body.center or ORIGIN])


def _corners(linkage: Linkage, body: Body, key: str = "poses") -> tuple[Place, ...]:
    """The outline of a body; one with a single joint reaches to the pins that slide in it."""
    at = [Place((key, body.name), p) for p in _outline(linkage, body).tolist()]
    if len(at) == 1:
        loops = (x for x in linkage.loop if x.kind.has_axis and x.bodies[1] == body.name)
        at += [Place((key, loop.bodies[0]), loop.at[0]) for loop in loops]
    return (*at,)


def _strokes(linkage: Linkage, body: Body, key: str = "poses") -> list[tuple[Place, ...]]:
    """The lines of a body in space, from the joint that carries it to each other point of it at
    which something acts, to its centre of mass where there is none."""
    carried = next(joint.at_child for joint in linkage.joint if joint.child == body.name)
    ends = [full(linkage, at) for at in (carried, *attachment_points(linkage, body.name))]
    first, *others = dict.fromkeys(ends)
    others = others or [full(linkage, body.center)]
    return [(Place((key, body.name), first), Place((key, body.name), end)) for end in others]


def _body(linkage: Linkage, body: Body, color: str) -> Iterator[Mark]:
    if linkage.dimension > 2:
        for at in _strokes(linkage, body):
            if at[0] != at[1]:
                yield Mark("body", "line", at, color, width=5)
            else:
                yield Mark("body", "square", at[:1], None, f"{color}80")
        return
    at = _corners(linkage, body)
    if len({place.path for place in at}) > 1 or len(at) == 2:
        yield Mark("body", "line", at, color, width=5)
    elif len(at) > 2:
        yield Mark("body", "area", at, color, f"{color}40", 2.5)
    elif not body.shape:
        yield Mark("body", "square", at, None, f"{color}80")
    if body.shape:
        shape = (*(_on(body.name, p) for p in contact_shape(body).tolist()),)
        yield Mark("body", "area", shape, color, f"{color}40", 0.8)


def _rods(linkage: Linkage) -> Iterator[Mark]:
    """The rods that are closures."""
    rods = (loop for loop in linkage.loop if "distance" in loop.kind.holds)
    for i, rod in enumerate(rods):
        at = (*(_on(body, end) for body, end in zip(rod.bodies, rod.at, strict=True)),)
        yield Mark("body", "line", at, "#8c8c8c", width=2.5, label="" if i else "rod")


def _slides(linkage: Linkage) -> Iterator[Mark]:
    """What is on the ground, the lines along which joints slide, and in space the axes about which
    they turn."""
    points = ([*attachment_points(linkage, b.name)] or [b.center or ORIGIN] for b in linkage.body)
    sizes = (np.ptp([full(linkage, at) for at in each], axis=0).max() for each in points)
    beyond = BEYOND * (float(max(sizes)) or 0.1)
    for joint in linkage.joint:
        ends = (_on(joint.child, joint.at_child), _on(joint.parent, joint.at_parent))
        if joint.parent == "ground" and joint.kind.mark:
            yield Mark("ground", "ground", ends[1:], None, "#8c8c8c")
        if joint.kind.has_axis or (joint.kind.axes and joint.kind.slides):
            yield _rail(linkage, ends, joint.axis, beyond)
        elif linkage.dimension > 2 and joint.kind.axes:
            yield from _axes(linkage, joint, beyond / 2)
    for loop in linkage.loop:
        pin, guide = (_on(b, at) for b, at in zip(loop.bodies, loop.at, strict=True))
        if "ground" in loop.bodies:
            yield Mark("ground", "ground", (pin,), None, "#8c8c8c")
        if loop.kind.has_axis or (loop.kind.axes and loop.kind.slides):
            axis = loop.axis if linkage.dimension == 2 else (loop.axes or (Z, Z))[1]
            yield _rail(linkage, (pin, guide), axis, beyond)


def _direction(linkage: Linkage, axis: float | Point | None, length: float) -> Points:
    """A vector of a length (m) along an axis: an angle from x in the plane, else a direction."""
    if linkage.dimension > 2:
        along = np.array(Z if axis is None else axis)
        return length * along / np.linalg.norm(along)
    angle = axis if isinstance(axis, int | float) else 0.0
    return length * np.array([np.cos(angle), np.sin(angle)])


def _rail(
    linkage: Linkage, ends: tuple[Place, Place], axis: float | Point | None, beyond: float
) -> Mark:
    """axis: in the frame of the second end."""
    past = np.array(full(linkage, ends[1].point)) + _direction(linkage, axis, beyond)
    at = (*ends, ends[1]._replace(point=past.tolist()))
    return Mark("rail", "rail", at, GREY, None, 1.0, (6.4, 1.6, 1.0, 1.6))


def _axes(linkage: Linkage, joint: Joint, half: float) -> Iterator[Mark]:
    """The axes about which a joint turns, the first one in its parent's frame, to `half` (m) on
    both its sides."""
    frames = ((joint.parent, joint.at_parent, joint.axis),
              (joint.child, joint.at_child, joint.second_axis))  # fmt: skip
    for body, at, axis in frames[: joint.kind.axes]:
        along, middle = _direction(linkage, axis, half), np.array(full(linkage, at))
        ends = (*(_on(body, (middle + side * along).tolist()) for side in (-1, 1)),)
        yield Mark("rail", "line", ends, GREY, width=1.5, label="axis of a joint")


def _springs(linkage: Linkage) -> Iterator[Mark]:
    for i, spring in enumerate(linkage.spring):
        at = (*(_on(b, at) for b, at in zip(spring.bodies, spring.at, strict=True)),)
        label = "" if i else "spring or damper"
        yield Mark("spring", "spring", at, "#4d4d4d", width=1.0, label=label)


def _joints(linkage: Linkage) -> Iterator[Mark]:
    for joint in linkage.joint:
        ends = _on(joint.child, joint.at_child), _on(joint.parent, joint.at_parent)
        if joint.kind.mark == "slider":  # in the plane turned like the line along which it slides
            angle = joint.axis_angle if linkage.dimension == 2 else None
            yield Mark("joint", "slider", ends, fill="#ffffff", angle=angle)
        elif joint.kind.mark:
            at = ends[0] if joint.kind.slides else ends[1]
            yield Mark("joint", joint.kind.mark, (at,), fill="#ffffff")
    for i, loop in enumerate(linkage.loop):
        label = "" if i else "joint that closes a loop"
        pins = [_on(body, at) for body, at in zip(loop.bodies, loop.at, strict=True)]
        for pin in pins if "distance" in loop.kind.holds else pins[:1]:
            yield Mark("joint", "pin", (pin,), fill=INK, label=label)


def _points(linkage: Linkage) -> Iterator[Mark]:
    for i, body in enumerate(linkage.body):
        label = "" if i else "centre of mass"
        yield Mark("centre", "centre", (_on(body.name, body.center),), label=label)
    kind = "operational point"
    yield Mark("point", kind, (point_of(linkage, ""),), None, RED, label=kind)
    for point in linkage.point:
        yield Mark("point", "point", (_on(point.body, point.at),), None, RED,
                   label=f"point {point.name}")  # fmt: skip


def _arms(user: str, device: Device) -> Iterator[Mark]:
    """Each link of a device, from pin to pin."""
    saturated = state("saturated", user)
    for stroke, when in (("#bfbfbf", ""), (KINDS["saturated"][0], saturated)):
        first = 0
        for line in drawn_lines(device):
            at = (*(Place((*_of(user), "arms", first + k)) for k in range(len(line))),)
            label = "" if first or user or when else "arms of the device"
            yield Mark("device", "line", at, stroke, width=1.8, label=label, when=when)
            first += len(line)


def _directions(user: str) -> Mark:
    at, vector = (Place((*_of(user), "x")),), (*_of(user), "directions")
    label = "" if user else "constrained directions"
    return Mark("directions", "directions", at, "#aa3377aa", width=1.1, dash=(1.5, 3.7),
                label=label, vector=vector)  # fmt: skip


def _handle(user: str) -> Iterator[Mark]:
    """With its way to the point that it should be at."""
    at = (Place((*_of(user), "handle")),)
    yield Mark("handle", "line", (*at, Place((*_of(user), "x"))), RED, width=1.0, dash=(1.0, 1.6),
               label="" if user else "tracking error")  # fmt: skip
    if not user:
        yield Mark("handle", "ring", at, None, f"{KINDS['energy'][0]}99", when="energy")
    yield Mark("handle", "ring", at, RED, width=1.5, label="" if user else "handle")


def _forces(linkage: Linkage, users: Sequence[str]) -> Iterator[Mark]:
    for name, (meaning, color, where) in FORCES.items():
        for user in users:
            at, vector = (Place((*_of(user), where)),), (*_of(user), name)
            yield arrow("force", at, color, f"force, {meaning}", vector)
    for i, loop in enumerate(linkage.loop):
        at = (_on(loop.bodies[0], loop.at[0]),)
        yield arrow("cut", at, "#228833", "force, in the cut joints", ("cut", i))


def arrow(role: str, at: tuple[Place, ...], color: str, label: str, vector: Path) -> Mark:
    """A force at a place."""
    return Mark(role, "arrow", at, color, color, 2.2, (), label, size=PER_NEWTON, vector=vector)


def obstacles(contacts: Contacts | None) -> Iterator[Mark]:
    """Obstacles and enclosure."""
    if contacts is None:
        return
    label = iter(["obstacles"])
    for disc in contacts.disc:
        yield Mark("obstacle", "disc", (_on("ground", disc.center),), GREY, "#d9d9d9",
                   label=next(label, ""), size=disc.radius)  # fmt: skip
    for polygon in contacts.polygon:
        at = (*(_on("ground", p) for p in polygon.corners),)
        yield Mark("obstacle", "area", at, GREY, "#d9d9d9", label=next(label, ""))
    if contacts.enclosure:
        at = (*(_on("ground", p) for p in contacts.enclosure),)
        yield Mark("obstacle", "area", at, GREY, width=1.5, label="enclosure")


def _hull(points: Points) -> Points:
    """The corners of the convex hull of points that are sorted by x and then y, anticlockwise, by
    Andrew's monotone chain (Information Processing Letters 9, 1979, 216). scipy.spatial, which has
    one, takes as long to load as a figure to draw."""

    def chain(ordered: Points) -> list[Points]:
        kept: list[Points] = []
        for point in ordered:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], point) <= 0:
                kept.pop()
            kept.append(point)
        return kept[:-1]

    return np.array(chain(points) + chain(points[::-1]))


def _turn(a: Points, b: Points, c: Points) -> float:
    """Twice the area of the triangle a, b, c, positive where it turns anticlockwise."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
