"""A scene's linkage, with what it can touch, as a model of MuJoCo (MJCF).

The plane of the linkage is z = 0. Where a joint turns it has a hinge about z, where it slides a
slide, a free joint two slides and a hinge; loops are `connect` equalities between two sites, gears
equalities of joints. Pairs that can touch are listed, so that no others do: discs are spheres,
capsules capsules, polygons prisms along z, walls of the enclosure planes.

Each operational point has a site NAME and three actuators NAME.x, NAME.y and NAME.theta: the first
two pull along the world's axes, the last one on the sum of the hinges between ground and body,
which is the body's angle without jumps at half turns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from hapticlink.components.contact.broad_phase import near
from hapticlink.components.specs.bodies import Body, counterclockwise, edges
from hapticlink.components.specs.contacts import Contacts, Pair
from hapticlink.components.specs.linkage import Gear, Joint, Linkage, Loop, Spring
from hapticlink.components.specs.quantities import Place, Point, in_plane
from hapticlink.fmus.errors import FmuError

HEIGHT = 0.05
"""Half the height (m) of the prisms: more than any body enters another in the plane."""
RIGID = "0.9999 0.9999 0.001 0.5 2"
"""The impedance of closures and contacts: close to 1, so that only `solref` says how they give."""
HAND = "hand"
"""Site and actuators of the operational point; further points have those of their names."""


def mjcf(
    linkage: Linkage,
    contacts: Contacts | None = None,
    integrator: str = "Euler",
    *,
    pulled: bool = False,
) -> str:
    """The model's text; a run sets its time step. pulled: the operational point is drawn to a
    reference by two soft equalities, of its place and of its angle, whose targets and gains a run
    sets. Raises FmuError, with the remedy, for what has no counterpart in MuJoCo."""
    for why in _misfits(linkage):
        raise FmuError(f"engine = 'mujoco': {why}")
    root = ET.Element("mujoco", model="linkage")
    ET.SubElement(root, "compiler", angle="radian", fusestatic="false")
    option = ET.SubElement(
        root,
        "option",
        integrator=integrator,
        gravity=_xy(linkage.gravity),
        solver="Newton",
        iterations="100",
        tolerance="1e-14",
        cone="elliptic",
        jacobian="dense",
    )
    ET.SubElement(option, "flag", warmstart="disable", autoreset="disable")
    assets = ET.SubElement(root, "asset")
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(world, "site", name="world")
    touching = near(linkage, contacts) if contacts else ()
    shapes = _Shapes(assets, {n for p in touching for n in (p.body, p.obstacle)})
    if contacts:
        shapes.obstacles(world, contacts)
    _bodies(world, "ground", linkage, shapes)
    equality = ET.SubElement(root, "equality")
    _closures(equality, linkage)
    if pulled:
        reference = ET.SubElement(world, "body", name="reference", mocap="true")
        ET.SubElement(reference, "site", name="reference")
        ends = {"site1": HAND, "site2": "reference"}
        ET.SubElement(equality, "connect", {"name": "pull.place"} | ends)
        ET.SubElement(equality, "tendon", name="pull.angle", tendon1=f"{HAND}.angle")
    tendons, actuators = ET.SubElement(root, "tendon"), ET.SubElement(root, "actuator")
    for name, body, _ in points(linkage):
        _handle(tendons, actuators, name, chain(linkage, body))
    for i, spring in enumerate(linkage.spring):
        _spring(tendons, actuators, f"spring{i}", spring)
    _pairs(ET.SubElement(root, "contact"), contacts, touching)
    return ET.tostring(root, encoding="unicode")


def points(linkage: Linkage) -> Iterator[tuple[str, str, Place | None]]:
    """Name, body and position of each operational point."""
    hand = linkage.held
    yield HAND, hand.body, hand.at
    for point in linkage.point:
        yield point.name, point.body, point.at


def coordinates(linkage: Linkage) -> list[str]:
    """MuJoCo's joints in the order of the linkage's coordinates."""
    return [name for joint in linkage.joint for name in _names(joint)]


def offset(linkage: Linkage, gear: Gear) -> float:
    """The first coordinate of a gear where the second is 0."""
    if gear.offset is not None:
        return gear.offset
    first, second = (linkage.start.get(name, 0.0) for name in gear.joints)
    assert isinstance(first, float | int)
    assert isinstance(second, float | int)
    return first - gear.ratio * second


def chain(linkage: Linkage, body: str) -> list[str]:
    """The hinges between the ground and a body."""
    carrier = {j.child: j for j in linkage.joint}
    hinges: list[str] = []
    while body != "ground":
        joint = carrier[body]
        freedoms = zip(_names(joint), joint.kind.freedoms, strict=True)
        hinges += [name for name, freedom in freedoms if freedom.turns]
        body = joint.parent
    return hinges[::-1]


def _names(joint: Joint) -> list[str]:
    freedoms = joint.kind.freedoms
    return [f"{joint.name}.{f.name}" for f in freedoms] if len(freedoms) > 1 else [joint.name]


def _misfits(linkage: Linkage) -> Iterator[str]:
    """What this model does not hold, each with the remedy."""
    ours = "leave the block to hapticlink"
    if linkage.dimension > 2:
        yield f"a linkage in space is not passed on: {ours}"
    if linkage.driven:
        yield f"drives of joints are not passed on: {ours}"
    if linkage.force:
        yield f"forces of plugins are not passed on: {ours}"
    if any(j.ports for j in linkage.joint):
        yield f"`ports` of joints are not passed on: {ours}"
    for joint in linkage.joint:
        if not all(freedom.pure for freedom in joint.kind.freedoms):
            yield f"joint {joint.name!r} turns and slides at once: {ours}"
    for i, loop in enumerate(linkage.loop):
        if loop.kind.has_axis:
            yield f"loop {i + 1} is a {loop.type} joint, and only revolute ones are closed: {ours}"
        own = (loop.stiffness, loop.damping, loop.friction, loop.limits)
        if any(value is not None for value in own):
            yield f"loop {i + 1}: springs, friction and limits of a cut joint: cut another joint"
    for spring in linkage.spring:
        if spring.length is None and "ground" not in spring.bodies:
            yield f"a spring without `length` between {' and '.join(spring.bodies)}: give it one"
    for body in linkage.body:
        if not body.mass or not body.inertia:
            yield f"body {body.name!r} has no mass or inertia, which the engine needs: give it some"
        if body.corners and body.radius:
            yield f"body {body.name!r} is a rounded polygon: leave out its radius or its corners"


def _xy(point: Place | None) -> str:
    x, y = in_plane(point)
    return f"{x!r} {y!r} 0"


def _bodies(parent: ET.Element, name: str, linkage: Linkage, shapes: _Shapes) -> None:
    """The sites of the body `name`, and the bodies that it carries, into their element."""
    for site, carrier, position in _sites(linkage):
        if carrier == name:
            ET.SubElement(parent, "site", name=site, pos=_xy(position))
    for joint in linkage.joint:
        if joint.parent != name:
            continue
        body = next(b for b in linkage.body if b.name == joint.child)
        a, c = in_plane(joint.at_parent), in_plane(joint.at_child)
        element = ET.SubElement(parent, "body", name=body.name, pos=_xy((a[0] - c[0], a[1] - c[1])))
        inertia = " ".join([repr(body.inertia)] * 3)
        ET.SubElement(
            element, "inertial", pos=_xy(body.center), mass=repr(body.mass), diaginertia=inertia
        )
        _joint(element, joint, c)
        shapes.body(element, body)
        _bodies(element, body.name, linkage, shapes)


def _sites(linkage: Linkage) -> Iterator[tuple[str, str, Place | None]]:
    yield from points(linkage)
    tied: dict[str, Sequence[Loop | Spring]] = {"loop": linkage.loop, "spring": linkage.spring}
    for kind, pairs in tied.items():
        for i, pair in enumerate(pairs):
            for k in (0, 1):
                yield f"{kind}{i}.{k}", pair.bodies[k], pair.at[k]


def _joint(body: ET.Element, joint: Joint, position: Point) -> None:
    given: dict[str, float | None] = {
        "stiffness": joint.stiffness,
        "springref": joint.rest,
        "damping": joint.damping,
        "frictionloss": joint.friction,
    }
    attributes = {key: repr(float(value)) for key, value in given.items() if value is not None}
    if limits := joint.limits:
        ends = (limits.lower, -1e9), (limits.upper, 1e9)
        interval = " ".join(repr(none if end is None else end) for end, none in ends)
        attributes |= {"range": interval, "limited": "true", "solimplimit": RIGID}
    for name, freedom in zip(_names(joint), joint.kind.freedoms, strict=True):
        kind = "hinge" if freedom.turns else "slide"
        axis = "0 0 1" if freedom.turns else _xy(joint.direction(freedom))
        place = {"name": name, "type": kind, "axis": axis, "pos": _xy(position)}
        ET.SubElement(body, "joint", place | attributes)


def _closures(equality: ET.Element, linkage: Linkage) -> None:
    """Loops and gears; MuJoCo lengthens their time constant to the least that its step allows."""
    stiff = {"solref": "1e-6 1", "solimp": RIGID}
    for i in range(len(linkage.loop)):
        ET.SubElement(equality, "connect", {"site1": f"loop{i}.0", "site2": f"loop{i}.1"} | stiff)
    for gear in linkage.gear:
        ends = dict(zip(("joint1", "joint2"), gear.joints, strict=True))
        line = f"{offset(linkage, gear)!r} {gear.ratio!r} 0 0 0"
        ET.SubElement(equality, "joint", ends | {"polycoef": line} | stiff)


def _handle(tendons: ET.Element, actuators: ET.Element, name: str, hinges: list[str]) -> None:
    """The actuators of an operational point: force = ctrl."""
    for axis, gear in (("x", "1 0 0 0 0 0"), ("y", "0 1 0 0 0 0")):
        place = {"name": f"{name}.{axis}", "site": name, "refsite": "world", "gear": gear}
        ET.SubElement(actuators, "motor", place)
    if hinges:
        angle = ET.SubElement(tendons, "fixed", name=f"{name}.angle")
        for hinge in hinges:
            ET.SubElement(angle, "joint", joint=hinge, coef="1")
        place = {"name": f"{name}.theta", "tendon": f"{name}.angle"}
        ET.SubElement(actuators, "motor", place)


def _spring(tendons: ET.Element, actuators: ET.Element, name: str, spring: Spring) -> None:
    """Along the line between its points by a tendon; without a free length in both directions, by
    actuators against the ground."""
    k, d = spring.stiffness or 0.0, spring.damping or 0.0
    if spring.length is not None:
        law = {"stiffness": repr(k), "damping": repr(d), "springlength": repr(spring.length)}
        tendon = ET.SubElement(tendons, "spatial", {"name": name} | law)
        for i in (0, 1):
            ET.SubElement(tendon, "site", site=f"{name}.{i}")
        return
    moving, fixed = (0, 1) if spring.bodies[1] == "ground" else (1, 0)
    for axis in ("1 0 0 0 0 0", "0 1 0 0 0 0"):
        ends = {"site": f"{name}.{moving}", "refsite": f"{name}.{fixed}", "gear": axis}
        law = {"biastype": "affine", "gainprm": "0", "biasprm": f"0 {-k!r} {-d!r}"}
        ET.SubElement(actuators, "general", ends | law)


@dataclass(frozen=True)
class _Shapes:
    """Geoms of bodies and obstacles that can touch something (`used`), named as these."""

    assets: ET.Element
    used: set[str]

    def body(self, element: ET.Element, body: Body) -> None:
        if body.name not in self.used:
            return
        if body.corners:
            self._prism(element, body.name, body.corners)
        elif len(body.shape) == 1:
            self._disc(element, body.name, body.shape[0], body.radius or 0.0)
        else:
            ends = " ".join(map(_xy, body.shape))
            _geom(element, body.name, "capsule", fromto=ends, size=repr(body.radius))

    def obstacles(self, world: ET.Element, contacts: Contacts) -> None:
        for i, (a, b) in enumerate(walls(contacts)):
            inward = (a[1] - b[1], b[0] - a[0])
            _geom(world, f"enclosure.{i}", "plane", pos=_xy(a), zaxis=_xy(inward), size="0 0 1")
        for i, disc in enumerate(contacts.disc):
            self._disc(world, disc.name or f"disc{i + 1}", disc.center, disc.radius)
        for i, polygon in enumerate(contacts.polygon):
            self._prism(world, polygon.name or f"polygon{i + 1}", polygon.corners)

    def _disc(self, element: ET.Element, name: str, center: Point, radius: float) -> None:
        _geom(element, name, "sphere", pos=_xy(center), size=repr(radius))

    def _prism(self, element: ET.Element, name: str, corners: tuple[Point, ...]) -> None:
        vertices = (f"{x!r} {y!r} {z!r}" for z in (-HEIGHT, HEIGHT) for x, y in corners)
        ET.SubElement(self.assets, "mesh", name=name, vertex=" ".join(vertices))
        _geom(element, name, "mesh", mesh=name)


def _geom(element: ET.Element, name: str, kind: str, **attributes: str) -> None:
    ET.SubElement(element, "geom", {"name": name, "type": kind} | attributes)


def walls(contacts: Contacts) -> list[tuple[Point, Point]]:
    """The walls of the enclosure, with the inside on their left."""
    return edges(counterclockwise(contacts.enclosure)) if contacts.enclosure else []


def _pairs(element: ET.Element, contacts: Contacts | None, touching: tuple[Pair, ...]) -> None:
    for pair in touching:
        assert contacts
        count = len(walls(contacts))
        enclosed = pair.kind == "enclosure"
        for other in [f"enclosure.{i}" for i in range(count)] if enclosed else [pair.obstacle]:
            ends = {"geom1": pair.body, "geom2": other, "solimp": RIGID}
            if contacts.friction is None:
                ends["condim"] = "1"
            else:
                mu = repr(contacts.friction)
                ends |= {"condim": "3", "friction": f"{mu} {mu} 0 0 0"}
            ET.SubElement(element, "pair", ends)
