"""A device in joint coordinates: an open chain, or loops that dyads do not reach.

With W = dh/dq the Jacobian of its closures and J_h that of its handle, A = [W; E J_h] is square and
regular, and all rates follow from the handle's,

    qdot = B v,   qddot = B vdot + b,   [B_h B] = A^-1,   b = -A^-1 [w; E Jdot_h qdot]

so that with D and C qdot of (2.3), D with the rotors, and B' W' = 0,

    M_d = B' D B,   c = B' (D b + C qdot),   C_d = (dc/dv)/2

since c is quadratic in v. A place is moved by B dy, and its loops are closed by a step of Newton's
method that keeps the handle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import cast

import casadi as ca

from hapticlink.components.component import Signals
from hapticlink.components.device.device_model import DeviceModel, Parameters
from hapticlink.components.linkage.frame import Frame
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.device import Device, DeviceJoint


class JointCoordinates(DeviceModel):
    """A device whose place is q."""

    is_pose = False

    def __init__(self, device: Device) -> None:
        super().__init__(device)
        units = device.linkage.coordinate_units
        self.place = (len(units),), units
        self.start_place = self.start
        if not any(j.range for j in device.joint):
            raise ValueError("nothing ends its workspace: give the `range` of a joint")

    def handle(self, z: ca.SX, p: Parameters) -> ca.SX:
        return self.directions.pick(self._at(z, p).x_h)

    def rate(self, z: ca.SX, v: ca.SX, p: Parameters) -> ca.SX:
        return self._rates(z, p) @ v

    def gaps(self, z: ca.SX, p: Parameters) -> ca.SX:
        return self._placed(lambda at: at.h, z, p)

    def moved(self, z: ca.SX, dy: ca.SX, p: Parameters) -> ca.SX:
        q = z + self.rate(z, dy, p)
        if not self.device.loop:
            return q
        kept = ca.SX(self.directions.size, 1)
        return q - ca.solve(self._matrix(q, p), ca.vertcat(self.gaps(q, p), kept))

    def place_at(self, y: ca.SX, guess: ca.SX, p: Parameters, iterations: int) -> ca.SX:
        q = guess
        for _ in range(iterations):
            off = ca.vertcat(self.gaps(q, p), self.handle(q, p) - y)
            q = q - ca.solve(self._matrix(q, p), off)
        return q

    def frames(self, z: ca.SX, p: Parameters) -> Mapping[str, Frame]:
        return self._at(z, p).frames

    def joint_coordinates(self, z: ca.SX, p: Parameters, joints: Sequence[DeviceJoint]) -> ca.SX:
        return ca.vertcat(*(z[self._model.coordinate(j.name)] for j in joints))

    def joint_rates(self, z: ca.SX, p: Parameters, joints: Sequence[DeviceJoint]) -> ca.SX:
        B = self._rates(z, p)
        return ca.vertcat(*(B[self._model.coordinate(j.name), :] for j in joints))

    def motion(self, z: ca.SX, v: ca.SX, p: Parameters) -> tuple[ca.SX, ca.SX]:
        q, qd = ca.SX.sym("q", z.numel()), ca.SX.sym("qd", z.numel())
        at, B = LinkageModel(self.device.linkage, cast("Signals", p), q, qd), self._rates(q, p)
        still = ca.vertcat(at.w, self.directions.pick(at.Jdot_qd))
        b = -ca.solve(self._matrix(q, p), still)
        D = at.D + self._rotors(p)
        both = [B.T @ D @ B, B.T @ (D @ b + at.C_qd)]
        M, c = ca.substitute(both, [qd], [ca.densify(B @ v)])
        M, c = ca.substitute([M, c], [q], [ca.densify(z)])
        return M, c

    def dynamics(self, z: ca.SX, v: ca.SX, p: Parameters) -> tuple[ca.SX, ca.SX]:
        rate = ca.SX.sym("v", v.numel())
        M, c = self.motion(z, rate, p)
        (C,) = ca.substitute([ca.jacobian(c, rate) / 2], [rate], [ca.densify(v)])
        return M, C

    def margins(self, z: ca.SX, p: Parameters) -> ca.SX:
        """Those of ranges."""
        return self.range_margins(z, p)

    def margin_rates(self, z: ca.SX, p: Parameters) -> ca.SX:
        return self.range_rates(z, p)

    def _at(self, q: ca.SX, p: Parameters) -> LinkageModel:
        """The linkage at q: what neither is differentiated by q nor asks what depends on it."""
        linkage, given = self.device.linkage, cast("Signals", p)  # of which a model reads names
        return LinkageModel(linkage, given, q, ca.SX(q.numel(), 1))

    def _matrix(self, q: ca.SX, p: Parameters) -> ca.SX:
        """A."""
        return self._placed(lambda at: ca.vertcat(at.W, self.directions.pick(at.J_h)), q, p)

    def _placed(self, of: Callable[[LinkageModel], ca.SX], q: ca.SX, p: Parameters) -> ca.SX:
        """What is derived at symbols of the linkage, at q."""
        at = self._at(ca.SX.sym("q", q.numel()), p)
        (placed,) = ca.substitute([of(at)], [at.q], [ca.densify(q)])
        return placed

    def _rates(self, q: ca.SX, p: Parameters) -> ca.SX:
        """B."""
        k, n = self.directions.size, q.numel()
        return ca.solve(self._matrix(q, p), ca.SX.eye(n)[:, n - k :])

    def _rotors(self, p: Parameters) -> ca.SX:
        """The rotors' part of D, (n, n)."""
        n = len(self.start)
        turned = ca.SX(len(self.motors), n)
        for row, motor in enumerate(self.motors):
            turned[row, self._model.coordinate(motor.joint.name)] = 1
        turned = self._by_ratio(p, turned)
        inertias = p["rotor_inertia"] if "rotor_inertia" in p else ca.SX(len(self.motors), 1)
        return turned.T @ ca.diag(inertias) @ turned
