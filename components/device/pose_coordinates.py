"""A device in coordinates of its handle: every angle is an explicit function of y, dyad by dyad.

With a and c the known pins of a dyad, r and phi length and heading of c - a, l_1 and l_2 the sides
from a and c to the elbow, by the law of cosines

    alpha_1 = phi + s acos((l_1^2 + r^2 - l_2^2) / (2 l_1 r))
    alpha_2 = phi - s acos((l_2^2 + r^2 - l_1^2) / (2 l_2 r))

are the headings of the sides, a + l_1 u_1 + l_2 u_2 = c; s = +-1 selects the side of the elbow,
that of `start`. phi is measured from its value there, so that no angle jumps within half a turn of
it. The derivative of the closure, projected on u_2 and u_1, with n across u, gives

    alpha_1' = u_2 . (c' - a') / (l_1 u_2 . n_1),   alpha_2' = -u_1 . (c' - a') / (l_2 u_2 . n_1)

and once more, the accelerations at ydd = 0 by l_1 u_1 alpha_1'^2 + l_2 u_2 alpha_2'^2 + c'' - a''
in place of c' - a'. Unit vectors follow from the cosines without the angles, which encoders alone
need.

Where no triangle exists, r is taken at the limit: beyond reach the angles stay, so that all is
finite there, and the stops lead back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import is_
from typing import NamedTuple

import casadi as ca
import numpy as np

from hapticlink.components.device.device_model import DeviceModel, Parameters
from hapticlink.components.device.groups import Anchor, Dyad, PinPlace
from hapticlink.components.linkage.frame import Frame
from hapticlink.components.linkage.poses import poses
from hapticlink.components.linkage.rotations import Z_AXIS
from hapticlink.components.specs.device import Device, DeviceJoint

PAST_STOPS = 0.5
"""Of the way from the stops of two links to the limit of their reach, where rates grow without
bound: how near to it their triangle is solved."""
IN_LINE = 1e-3
"""Distance of an elbow from the line of its anchors, by that of these, up to which it is on it."""


def across(r: ca.SX) -> ca.SX:
    return ca.vertcat(-r[1], r[0])


class Point(NamedTuple):
    """A point of the world (m, 2), its Jacobian by y, (2, k), and its acceleration at vdot = 0
    (m/s2, 2)."""

    at: ca.SX
    J: ca.SX
    bias: ca.SX


@dataclass(frozen=True)
class PlacedBody:
    """A body: its frame, with a point of it, the Jacobian of its angle, (1, k), its rate (rad/s)
    and its acceleration at vdot = 0 (rad/s2)."""

    frame: Frame
    pin: Point
    turn: ca.SX
    rate: ca.SX
    bias: ca.SX

    def point(self, local: ca.SX | None) -> Point:
        at = self.frame.point(local)
        r = at - self.pin.at
        bias = self.pin.bias + across(r) * self.bias - r * self.rate**2
        return Point(at, self.pin.J + across(r) @ self.turn, bias)


class Solved(NamedTuple):
    """A dyad: the distance (m) of its anchors with its Jacobian, and the lengths of its sides."""

    reach: ca.SX
    J: ca.SX
    sides: tuple[ca.SX, ca.SX]


Placed = tuple[dict[str, PlacedBody], list[Solved]]


@dataclass(frozen=True)
class _Turns:
    """Of a dyad at the start: the heading of its span (rad), the side of its elbow, and whole turns
    of its two bodies that their joints count."""

    heading: float
    side: int
    whole: tuple[float, float]


class PoseCoordinates(DeviceModel):
    """A device of dyads."""

    is_pose = True

    def __init__(self, device: Device, dyads: Sequence[Dyad]) -> None:
        super().__init__(device)
        self._dyads = dyads
        k = self.directions.size
        self.place = (k,), device.space.pose.units[:k]
        self._frames0 = {
            name: values[0] for name, values in poses(device.linkage, [self.start.tolist()]).items()
        }
        self.start_place = self.start_pose[:k]
        self._turns = [self._at_start(dyad) for dyad in dyads]
        self._known: tuple[tuple[object, ...], Placed] | None = None
        self._require_room()

    def handle(self, z: ca.SX, p: Parameters) -> ca.SX:
        return z

    def rate(self, z: ca.SX, v: ca.SX, p: Parameters) -> ca.SX:
        return v

    def moved(self, z: ca.SX, dy: ca.SX, p: Parameters) -> ca.SX:
        return z + dy

    def place_at(self, y: ca.SX, guess: ca.SX, p: Parameters, iterations: int) -> ca.SX:
        return y

    def frames(self, z: ca.SX, p: Parameters) -> Mapping[str, Frame]:
        return {name: body.frame for name, body in self._placed(z, p)[0].items()}

    def joint_coordinates(self, z: ca.SX, p: Parameters, joints: Sequence[DeviceJoint]) -> ca.SX:
        frames = self.frames(z, p)
        return ca.vertcat(*(frames[j.child].angle - frames[j.parent].angle for j in joints))

    def joint_rates(self, z: ca.SX, p: Parameters, joints: Sequence[DeviceJoint]) -> ca.SX:
        bodies, _ = self._placed(z, p)
        return ca.vertcat(*(bodies[j.child].turn - bodies[j.parent].turn for j in joints))

    def motion(self, z: ca.SX, v: ca.SX, p: Parameters) -> tuple[ca.SX, ca.SX]:
        J, bias, m = self._all_jacobians(z, p, v)
        weighted = J.T @ ca.diag(m)
        return ca.triu2symm(ca.triu(weighted @ J)), weighted @ bias

    def dynamics(self, z: ca.SX, v: ca.SX, p: Parameters) -> tuple[ca.SX, ca.SX]:
        symbols = ca.SX.sym("y", z.numel())
        J, _, m = self._all_jacobians(symbols, p)
        J_dot = ca.reshape(ca.jtimes(ca.vec(ca.densify(J)), symbols, v), J.shape)
        weighted = J.T @ ca.diag(m)
        M, C = ca.substitute([weighted @ J, weighted @ J_dot], [symbols], [z])
        return M, C

    def margins(self, z: ca.SX, p: Parameters) -> ca.SX:
        """Of each dyad the distances of its span to (1 - stop_reach)(l_1 + l_2) before its two
        singular poses, stretched (l_1 + l_2) and folded (|l_1 - l_2|), the stretched ones first;
        then those of ranges."""
        _, solved = self._placed(z, p)
        longest, shortest = [], []
        for dyad in solved:
            whole, spare = sum(dyad.sides), 1 - p["stop_reach"]
            longest.append((1 - spare) * whole - dyad.reach)
            folded = ca.fabs(dyad.sides[0] - dyad.sides[1])
            shortest.append(dyad.reach - (folded + spare * whole))
        return ca.vertcat(*longest, *shortest, self.range_margins(z, p))

    def margin_rates(self, z: ca.SX, p: Parameters) -> ca.SX:
        spans = [dyad.J for dyad in self._placed(z, p)[1]]
        return ca.vertcat(*(-J for J in spans), *spans, self.range_rates(z, p))

    def _placed(self, y: ca.SX, p: Parameters, v: ca.SX | None = None) -> Placed:
        """All bodies and dyads at a place, with their motion at v, 0 by default. The last are
        kept: what is asked of a place is asked in a row."""
        if not (self._known and all(map(is_, self._known[0], (y, p, v)))):
            self._known = (y, p, v), self._place_bodies(y, p, v)
        return self._known[1]

    def _place_bodies(self, y: ca.SX, p: Parameters, v: ca.SX | None) -> Placed:
        k, handle, none = y.numel(), self.device.handle, ca.SX(2, 1)
        v = ca.SX(k, 1) if v is None else v
        still = Point(none, ca.SX(2, k), none), ca.SX(1, k), ca.SX(0), ca.SX(0)
        bodies = {"ground": PlacedBody(Frame.world(2), *still)}
        solved = list[Solved]()
        point = Point(y[:2], ca.SX.eye(k)[:2, :], none)
        if handle.angle == "held":
            local, frame = p.get("operational_point.at"), Frame.world(2).turned(Z_AXIS, y[2])
            motion = ca.SX.eye(k)[2:, :], v[2], ca.SX(0)
            bodies[handle.body] = self._on_pin(point, local, y[2], frame.rotation, *motion)
        for dyad, turns in zip(self._dyads, self._turns, strict=True):
            a, c = (
                point
                if anchor.known is None
                else bodies[anchor.known.body].point(p.get(anchor.known.parameter))
                for anchor in (dyad.first, dyad.second)
            )
            both, found = self._solve(dyad, turns, a, c, p, v)
            bodies |= both
            solved.append(found)
        return bodies, solved

    def _solve(
        self, dyad: Dyad, turns: _Turns, a: Point, c: Point, p: Parameters, v: ca.SX
    ) -> tuple[dict[str, PlacedBody], Solved]:
        own = (
            self._side(dyad.first, dyad.first_elbow, p),
            self._side(dyad.second, dyad.second_elbow, p),
        )
        (l1, _), (l2, _) = own
        d, span = c.at - a.at, c.J - a.J
        r = ca.norm_2(d)
        spare = PAST_STOPS * (1 - self.device.stop.reach) * (l1 + l2)
        near = ca.fmax(ca.fmin(r, l1 + l2 - spare), ca.fabs(l1 - l2) + spare)
        cos1, cos2 = (
            (one**2 + near**2 - other**2) / (2 * one * near) for one, other in ((l1, l2), (l2, l1))
        )
        sin1 = turns.side * ca.sqrt(1 - cos1**2)
        along, beside = d / r, across(d / r)
        u1 = cos1 * along + sin1 * beside
        u2 = cos2 * along - (l1 / l2) * sin1 * beside
        s = ca.dot(u2, across(u1))
        J1, J2 = u2.T @ span / (l1 * s), -(u1.T @ span) / (l2 * s)
        # Beyond the limit the angles stay, and have no terms of the velocity.
        w1, w2 = (ca.if_else(near == r, J @ v, 0) for J in (J1, J2))
        pull = c.bias - a.bias + l1 * u1 * w1**2 + l2 * u2 * w2**2
        pull = ca.if_else(near == r, pull, 0)
        b1, b2 = ca.dot(u2, pull) / (l1 * s), -ca.dot(u1, pull) / (l2 * s)
        # The angles are those of the sides as motors and encoders count them; the second side runs
        # from its anchor to the elbow, against u_2.
        cos, sin = np.cos(turns.heading), np.sin(turns.heading)
        phi = turns.heading + ca.atan2(cos * d[1] - sin * d[0], cos * d[0] + sin * d[1])
        headings = (
            phi + turns.side * ca.acos(cos1) + turns.whole[0],
            phi - turns.side * ca.acos(cos2) + ca.pi + turns.whole[1],
        )
        both = {}
        for body, pin, anchor, elbow, u, (length, side), heading, motion in zip(
            dyad.bodies, (a, c), (dyad.first, dyad.second), (dyad.first_elbow, dyad.second_elbow),
            (u1, -u2), own, headings, ((J1, w1, b1), (J2, w2, b2)), strict=True,
        ):  # fmt: skip
            rotation = ca.horzcat(u, across(u)) @ ca.horzcat(side, across(side)).T / length
            angle = heading - self._heading(anchor, elbow, side)
            local = p.get(anchor.on.parameter)
            both[body] = self._on_pin(pin, local, angle, rotation, *motion)
        return both, Solved(r, along.T @ span, (l1, l2))

    @staticmethod
    def _on_pin(
        pin: Point, local: ca.SX | None, angle: ca.SX, rotation: ca.SX, *motion: ca.SX
    ) -> PlacedBody:
        """The body at an angle whose point `local` is at a pin."""
        origin = pin.at if local is None else pin.at - rotation @ local
        return PlacedBody(Frame(origin, rotation, angle), pin, *motion)

    def _side(self, anchor: Anchor, elbow: PinPlace, p: Parameters) -> tuple[ca.SX, ca.SX]:
        """Length (m) of the side from anchor to elbow, and itself in the body's frame."""
        ends = [p.get(place.parameter, ca.SX.zeros(2)) for place in (anchor.on, elbow)]
        side = ca.SX(ends[1]) - ca.SX(ends[0])
        return ca.norm_2(side), side

    def _heading(self, anchor: Anchor, elbow: PinPlace, side: ca.SX) -> ca.SX:
        """The heading (rad) of that side in the body's frame, next to that of the device as it is
        described: of a side along -x a 0 of another sign would be a turn more."""
        x, y = self._local(elbow) - self._local(anchor.on)
        turn = ca.atan2(x * side[1] - y * side[0], x * side[0] + y * side[1])
        return float(np.arctan2(y, x)) + turn

    def _all_jacobians(
        self, y: ca.SX, p: Parameters, v: ca.SX | None = None
    ) -> tuple[ca.SX, ca.SX, ca.SX]:
        """(J, Jdot v, m): of every centre of mass, angle and rotor, stacked, the Jacobian by y, the
        acceleration at vdot = 0, and the mass or moment of inertia that belongs to each row."""
        bodies, _ = self._placed(y, p, v)
        rows, biases, inertias = [], [], []
        for body in self.device.body:
            placed, mass = bodies[body.name], p[f"{body.name}.mass"]
            center = placed.point(p.get(f"{body.name}.center"))
            rows += [center.J, placed.turn]
            biases += [center.bias, placed.bias]
            inertias += [mass, mass, p[f"{body.name}.inertia"]]
        if "rotor_inertia" in p:
            driven = [motor.joint for motor in self.motors]
            rows.append(self.jacobian(y, p))
            spins = [bodies[j.child].bias - bodies[j.parent].bias for j in driven]
            biases.append(self._by_ratio(p, ca.vertcat(*spins)))
            inertias.append(p["rotor_inertia"])
        return ca.vertcat(*rows), ca.vertcat(*biases), ca.vertcat(*inertias)

    def _at_start(self, dyad: Dyad) -> _Turns:
        """The dyad's turns where the device is assembled."""
        pins = dyad.first.on, dyad.first_elbow, dyad.second.on
        a, elbow, c = (self._point0(place) for place in pins)
        span, side = c - a, elbow - a
        cross = float(span[0] * side[1] - span[1] * side[0])
        if abs(cross) < IN_LINE * float(span @ span):
            raise ValueError(
                f"at `start` the pins of bodies `{dyad.bodies[0]}` and `{dyad.bodies[1]}` are in "
                "line, which leaves the side of their elbow open: give other angles"
            )
        heading = float(np.arctan2(span[1], span[0]))
        whole = []
        for anchor, end in ((dyad.first, dyad.first_elbow), (dyad.second, dyad.second_elbow)):
            # As the equations count: the first side's heading within half a turn of the span's, the
            # second's from the elbow on.
            side = self._point0(end) - self._point0(anchor.on)
            side = side if anchor is dyad.first else -side
            turn = np.arctan2(
                span[0] * side[1] - span[1] * side[0], span[0] * side[0] + span[1] * side[1]
            )
            counted = heading + turn + (0.0 if anchor is dyad.first else np.pi)
            own = self._local(end) - self._local(anchor.on)
            angle = counted - np.arctan2(own[1], own[0])
            turns = (self._frames0[end.body][2] - angle) / (2 * np.pi)
            whole.append(2 * np.pi * round(float(turns)))
        return _Turns(heading, 1 if cross > 0 else -1, (whole[0], whole[1]))

    def _require_room(self) -> None:
        """Raises ValueError where a dyad has nothing between its two stops."""
        for dyad in self._dyads:
            one, other = (
                float(np.linalg.norm(self._local(elbow) - self._local(anchor.on)))
                for anchor, elbow in (
                    (dyad.first, dyad.first_elbow),
                    (dyad.second, dyad.second_elbow),
                )
            )
            whole, folded = one + other, abs(one - other)
            if (2 * self.device.stop.reach - 1) * whole <= folded:
                raise ValueError(
                    f"stop.reach = {self.device.stop.reach} leaves bodies `{dyad.bodies[0]}` and "
                    f"`{dyad.bodies[1]}` nothing between their two stops, as their lengths differ "
                    f"by {folded:.6g} m: give more than {(1 + folded / whole) / 2:.6g}, or more "
                    "equal lengths"
                )

    def _local(self, place: PinPlace) -> np.ndarray:
        value = self.numbers.get(place.parameter)
        return np.zeros(2) if value is None else np.array(ca.DM(value)).ravel()

    def _point0(self, place: PinPlace) -> np.ndarray:
        x, y, angle = self._frames0[place.body]
        c, s = np.cos(angle), np.sin(angle)
        point: np.ndarray = np.array([x, y]) + np.array([[c, -s], [s, c]]) @ self._local(place)
        return point
