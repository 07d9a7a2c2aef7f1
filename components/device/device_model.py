"""A device: kinematics and dynamics at its handle, for any linkage with motors and encoders.

A *place* z says where all bodies are, y = E x is where the handle is in the k directions in which
it is felt, and v = ydot. With the stacked velocities J v of all bodies and rotors, and the diagonal
matrix m of their inertias,

    M_d = J' m J,   C_d = J' m Jdot,   M_d vdot + C_d v = J_q' tau + E F           (4.5)

so that dM_d/dt - 2 C_d is skew. J_q, (m, k), are the rates of the motors' axes, by ratio. What z
is, and how J follows from it, is that of two kinds: `PoseCoordinates` where dyads reach every body,
and z = y; `JointCoordinates`, z = q, for open chains and all else."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.component import Signals, Variable
from hapticlink.components.dynamics.rendered_directions import rendered_directions
from hapticlink.components.linkage.frame import Frame
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import body_parameters
from hapticlink.components.specs.device import Device, DeviceJoint
from hapticlink.components.specs.linkage import coordinates

Parameters = Mapping[str, ca.SX]
FRICTION_RATE = 0.1
"""Least rate (rad/s) over which dry friction changes its sign."""
ASSEMBLED, STEPS = 1e-10, 50
"""Gap (m) at which a device is assembled, and steps of Newton's method that may lead there."""
FROM_START, REACHED = 10, 1e-6
"""Steps of Newton's method from the start to a pose, and the distance (m) at which it is
reached."""


class DeviceModel(ABC):
    """What blocks ask of a device, as functions of its parameters p. Places are (n,), y and v (k,),
    angles of encoders (e,), of motors (m,). Raises ValueError for a device that cannot be
    assembled near its `start`, or that does not move in the k directions alone."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.directions = rendered_directions(device.handle, device.space)
        self.motors, self.encoders = device.motors, device.encoders
        self.start = self._assembled()
        x_h = ca.Function("x_h", [self._model.q, self._model.p.vector], [self._model.x_h])
        self.start_pose = np.array(x_h(self.start, self._values)).ravel()
        self._require_fit()

    # What depends on the kind of coordinates

    place: tuple[tuple[int, ...], tuple[str, ...]]
    """Shape and units of a place."""
    is_pose: bool
    """Whether a place is y itself."""
    start_place: NDArray[np.float64]
    """That of the start."""

    @abstractmethod
    def handle(self, z: ca.SX, p: Parameters) -> ca.SX:
        """y."""

    @abstractmethod
    def rate(self, z: ca.SX, v: ca.SX, p: Parameters) -> ca.SX:
        """zdot."""

    @abstractmethod
    def moved(self, z: ca.SX, dy: ca.SX, p: Parameters) -> ca.SX:
        """The place, with closed loops, from which the handle has moved by a small dy."""

    @abstractmethod
    def place_at(self, y: ca.SX, guess: ca.SX, p: Parameters, iterations: int) -> ca.SX:
        """The place at which the handle is at y, near a guess."""

    @abstractmethod
    def frames(self, z: ca.SX, p: Parameters) -> Mapping[str, Frame]:
        """World frame of every body."""

    @abstractmethod
    def joint_coordinates(self, z: ca.SX, p: Parameters, joints: Sequence[DeviceJoint]) -> ca.SX:
        """Angles (rad) and displacements (m) of joints."""

    @abstractmethod
    def joint_rates(self, z: ca.SX, p: Parameters, joints: Sequence[DeviceJoint]) -> ca.SX:
        """The Jacobian of joint coordinates by y."""

    @abstractmethod
    def motion(self, z: ca.SX, v: ca.SX, p: Parameters) -> tuple[ca.SX, ca.SX]:
        """M_d (k, k) and the vector c = C_d v (k,)."""

    @abstractmethod
    def dynamics(self, z: ca.SX, v: ca.SX, p: Parameters) -> tuple[ca.SX, ca.SX]:
        """M_d and C_d, both (k, k)."""

    @abstractmethod
    def margins(self, z: ca.SX, p: Parameters) -> ca.SX:
        """Distances (m) to the limits of the workspace; a negative one lies outside."""

    @abstractmethod
    def margin_rates(self, z: ca.SX, p: Parameters) -> ca.SX:
        """The Jacobian of `margins` by y."""

    # What follows for any kind

    def gaps(self, z: ca.SX, p: Parameters) -> ca.SX:
        """The gaps (m) of the loops that a place may leave open."""
        return ca.SX(0, 1)

    def place_at_pose(self, pose: ca.SX, p: Parameters | None = None) -> ca.SX:
        """The place at which the handle is at a pose (3,), from the start on; p by default as
        numbers."""
        y, start = self.directions.pick(pose), ca.SX(ca.DM(self.start_place))
        return self.place_at(y, start, self.numbers if p is None else p, FROM_START)

    def least_margin(self, z: ca.SX, p: Parameters, *off: ca.SX) -> ca.SX:
        """The smallest of `margins`; where loops are open, or anything else is `off`, how far."""
        least, apart = ca.mmin(self.margins(z, p)), ca.vertcat(self.gaps(z, p), *off)
        if not apart.numel():
            return least
        return ca.if_else(ca.norm_2(apart) < REACHED, least, -ca.norm_2(apart))

    def margin_at(self, pose: ca.SX) -> ca.SX:
        """The smallest of `margins` at a pose (3,); negative where no place is found."""
        z, p = self.place_at_pose(pose), self.numbers
        return self.least_margin(z, p, self.handle(z, p) - self.directions.pick(pose))

    def angles(self, z: ca.SX, p: Parameters) -> ca.SX:
        """q, the coordinates of the joints with encoders, (e,)."""
        return self.joint_coordinates(z, p, [sensed.joint for sensed in self.encoders])

    def angle_rates(self, z: ca.SX, p: Parameters) -> ca.SX:
        """The Jacobian of `angles` by y, (e, k)."""
        return self.joint_rates(z, p, [sensed.joint for sensed in self.encoders])

    def motor_angles(self, z: ca.SX, p: Parameters) -> ca.SX:
        """The angles (rad) of the motors' axes, (m,)."""
        driven = self.joint_coordinates(z, p, [motor.joint for motor in self.motors])
        return self._by_ratio(p, driven)

    def jacobian(self, z: ca.SX, p: Parameters) -> ca.SX:
        """J_q, (m, k): qdot = J_q v, and torques tau give J_q' tau along y."""
        return self._by_ratio(p, self.joint_rates(z, p, [m.joint for m in self.motors]))

    def _by_ratio(self, p: Parameters, of_joints: ca.SX) -> ca.SX:
        return ca.diag(p["ratio"]) @ of_joints if "ratio" in p else of_joints

    def friction_torques(self, rates: ca.SX, scales: ca.SX, p: Parameters) -> ca.SX:
        """-b omega - f tanh(omega/omega_f) at rates omega (rad/s) of the motors' axes, (m,), with
        viscous damping b, dry friction f and the `scales` omega_f."""
        return -p["motor_damping"] * rates - p["motor_friction"] * ca.tanh(rates / scales)

    def friction_scales(self, J: ca.SX, inertia: ca.SX, h: ca.SX, p: Parameters) -> ca.SX:
        """omega_f (rad/s), (m,): FRICTION_RATE, or more where a step h would overshoot. d, the
        diagonal of J M^-1 J', are the mobilities of the axes. That m f d h/omega_f <= 1 of each
        bounds the trace of h M^-1 J' diag(f/omega_f) J, and so its eigenvalues, by 1."""
        mobilities = ca.diag(J @ ca.solve(inertia, J.T))
        return ca.fmax(FRICTION_RATE, len(self.motors) * h * p["motor_friction"] * mobilities)

    def stop_force(self, z: ca.SX, v: ca.SX, p: Parameters) -> ca.SX:
        """The stops along y, (k,): a unilateral spring and damper for each negative margin m, with
        the force max(0, -K m - B mdot) in the direction in which m grows."""
        gap, slope = self.margins(z, p), self.margin_rates(z, p)
        push = -p["stop_stiffness"] * gap - p["stop_damping"] * (slope @ v)
        return slope.T @ ca.if_else(gap < 0, ca.fmax(0, push), 0)

    def motor_torques(self, F: ca.SX, z: ca.SX, p: Parameters) -> ca.SX:
        """Torques (N.m, m) of least norm that give the force F along y, J_q (J_q' J_q)^-1 F.

        If one would exceed its limit all are scaled by one factor, which keeps the direction.
        """
        J = self.jacobian(z, p)
        tau = J @ ca.solve(J.T @ J, F)
        return tau / ca.fmax(1, ca.mmax(ca.fabs(tau) / p["torque_limit"]))

    def place_from_angles(
        self, angles: ca.SX, guess: ca.SX, p: Parameters, iterations: int = 2
    ) -> ca.SX:
        """Forward kinematics: the place whose encoders are nearest to the angles, in counts.

        Least squares by Gauss-Newton from a nearby guess, weighted by the resolutions. Angles stay
        within half a turn of the guess. Two iterations from a guess 5 mm away leave less than 1 %
        of one encoder count of the twin."""
        z = guess
        for _ in range(iterations):
            z = self.moved(z, self.way_from_angles(angles, z, p), p)
        return z

    def way_from_angles(self, angles: ca.SX, z: ca.SX, p: Parameters) -> ca.SX:
        """The step of Gauss-Newton along y, (k,)."""
        J, off = self._in_counts(self.angle_rates(z, p)), angles - self.angles(z, p)
        return ca.solve(J.T @ J, J.T @ self._in_counts(off))

    def _in_counts(self, of_encoders: ca.SX) -> ca.SX:
        """By their resolutions relative to the finest one: 1 where all are alike."""
        finest = min(sensed.resolution for sensed in self.encoders)
        weights = [finest / sensed.resolution for sensed in self.encoders]
        return of_encoders if set(weights) == {1.0} else ca.diag(ca.DM(weights)) @ of_encoders

    def range_margins(self, z: ca.SX, p: Parameters) -> ca.SX:
        """Of each joint with a range the ways (m) of the handle to its two ends, to first order."""
        found = [ca.SX(0, 1)]
        for joint in self._ranged:
            low, high = joint.range or (0.0, 0.0)
            q, way = self.joint_coordinates(z, p, [joint]), self._way(z, p, joint)
            found += [way * (high - q), way * (q - low)]
        return ca.vertcat(*found)

    def range_rates(self, z: ca.SX, p: Parameters) -> ca.SX:
        """The Jacobian of `range_margins` by y, with the way of a unit held."""
        found = [ca.SX(0, self.directions.size)]
        for joint in self._ranged:
            row = self._way(z, p, joint) * self.joint_rates(z, p, [joint])
            found += [-row, row]
        return ca.vertcat(*found)

    def _way(self, z: ca.SX, p: Parameters, joint: DeviceJoint) -> ca.SX:
        """The least way (m) of the handle for a unit of a joint's coordinate."""
        return 1 / ca.norm_2(self.joint_rates(z, p, [joint])[:, : self.directions.lengths])

    @property
    def _ranged(self) -> list[DeviceJoint]:
        return [joint for joint in self.device.placed if joint.range]

    # The start

    @cached_property
    def parameters(self) -> list[Variable]:
        """Geometry and inertia of its bodies and rotors, `fixed`."""
        return [*body_parameters(self.device.linkage), *self._motor_parameters()]

    def _motor_parameters(self) -> list[Variable]:
        m = (len(self.motors),)
        inertias, ratios = ([getattr(motor, key) for motor in self.motors] for key in _OF_MOTORS)
        found = []
        if any(inertias):
            text = "inertia of each motor's rotor"
            found.append(Variable("rotor_inertia", m, "kg.m2", tuple(inertias), text, "fixed"))
        if set(ratios) - {1.0}:
            units = tuple("1" if d.joint.type == "revolute" else "rad/m" for d in self.motors)
            text = "turn of each rotor by that of its joint"
            found.append(Variable("ratio", m, units, tuple(ratios), text, "fixed"))
        return found

    @cached_property
    def limits(self) -> list[Variable]:
        """Torque limits, stops and friction, `tunable`."""
        m, motors, stop = (len(self.motors),), self.motors, self.device.stop

        def of_motors(name: str, key: str, unit: str, text: str) -> Variable:
            return Variable(name, m, unit, tuple(getattr(d, key) for d in motors), text)

        found = [of_motors("torque_limit", "torque_limit", "N.m", "largest torque of each motor")]
        found += [
            Variable("stop_reach", (), "1", stop.reach, "fraction of a reach at which stops begin"),
            Variable("stop_stiffness", (), "N/m", stop.stiffness, "stiffness of the stops"),
            Variable("stop_damping", (), "N.s/m", stop.damping, "damping of the stops"),
        ]
        if any(d.damping or d.friction for d in motors):
            text = "about each motor's axis"
            found.append(
                of_motors("motor_damping", "damping", "N.m.s/rad", f"viscous damping {text}")
            )
            found.append(of_motors("motor_friction", "friction", "N.m", f"dry friction {text}"))
        return found

    @cached_property
    def numbers(self) -> dict[str, ca.SX]:
        """All parameters of kinematics, dynamics, motors and stops by name, as numbers."""
        given = Signals("p", [*self.parameters, *self.limits])
        values = ca.SX(ca.DM(given.starts))
        function = ca.Function(
            "p", [given.vector], [ca.vec(given[v.name]) for v in given.variables]
        )
        found = function.call([values])
        return dict(zip(given, found, strict=True))

    def _assembled(self) -> NDArray[np.float64]:
        """Joint coordinates (n,) near `start` at which its loops close."""
        linkage = self.device.linkage
        p = Signals("p", body_parameters(linkage))
        model = LinkageModel.symbolic(linkage, p)
        self._model, self._values = model, p.starts
        closed = ca.Function("closed", [model.q, p.vector], [model.h, model.W])
        q = np.array(coordinates(linkage, self.device.start))
        for _ in range(STEPS):
            h, W = (np.array(value) for value in closed(q, p.starts))
            if not np.abs(h).max(initial=0.0) > ASSEMBLED / 100:
                return q
            q = q - np.linalg.pinv(W, 1e-6) @ h.ravel()
        gap = float(np.abs(np.array(closed(q, p.starts)[0])).max())
        if gap > ASSEMBLED:
            raise ValueError(
                f"its loops do not close near `start`: {gap:.3g} m are left; give other angles"
            )
        return q

    def _require_fit(self) -> None:
        """Raises ValueError where the linkage does not move in the k directions alone, or where it
        has fewer motors or encoders than directions."""
        model, k = self._model, self.directions.size
        both = ca.Function("J", [model.q, model.p.vector], [model.W, model.J_h])
        W, J_h = (np.array(value) for value in both(self.start, self._values))
        J = np.array(self.directions.rows) @ J_h
        rank = int(np.linalg.matrix_rank(W, 1e-9)) if len(W) else 0
        free = W.shape[1] - rank
        handle, in_plane = self.device.handle, any(self.device.space.turns)
        ways, remedy = "a point in space", "give it as many joints"
        if in_plane:
            ways = f'handle.angle = "{handle.angle}"' + (" and `along`" if handle.along else "")
            remedy = "give `along` to one of one, a held angle to one of three"
        if free != k or rank < len(W):
            raise ValueError(
                f"its linkage has {free} degrees of freedom, and {ways} leaves {k} to be felt: "
                f"{remedy}"
            )
        if np.linalg.matrix_rank(np.vstack([W, J]), 1e-6) < len(self.start):
            raise ValueError(
                f"at `start` its handle does not move in all the {k} directions that {ways} leaves"
            )
        turn = np.array(J_h)[2] @ np.linalg.pinv(np.vstack([W, J]))[:, len(W) :]
        if handle.angle == "fixed" and np.abs(turn).max() > 1e-6:
            raise ValueError(
                f'{ways} and body `{handle.body}` turns as the handle moves: give angle = "free"'
            )
        for what, count in (("motors", len(self.motors)), ("encoders", len(self.encoders))):
            if count < k:
                raise ValueError(f"it has {count} {what} for {k} directions: {ways} leaves so many")


_OF_MOTORS = ("inertia", "ratio")
