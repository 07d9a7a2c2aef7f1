"""A linkage in absolute coordinates (x, y, theta of every centre of mass), with a multiplier for
every joint: a formulation that shares nothing with the one in joint coordinates but the scene.

    M a - Phi_q' lambda = Q,   Phi_q a = -(Phi_q v)_q v,   DOP853 at tight tolerance

Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems I (1989), chapters 3 and 6.
"""

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from hapticlink.components.linkage.poses import poses
from hapticlink.components.specs.linkage import Linkage


def _turn(angle, at):
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(c * at[0] - s * at[1], s * at[0] + c * at[1])


class Absolute:
    """The linkage's equations, its joints' coordinates at `q0` and rates `qd0` (n,). Raises
    ValueError for joints of another type."""

    def __init__(self, linkage: Linkage, q0, qd0) -> None:
        for joint, known in (
            *((joint, ("revolute", "prismatic")) for joint in linkage.joint),
            *((loop, ("revolute", "slot", "prismatic")) for loop in linkage.loop),
        ):
            if joint.type not in known:
                raise ValueError(f"write the equations of a {joint.type} joint here")
        self.linkage, self.n = linkage, 3 * len(linkage.body)
        self._at = {b.name: 3 * i for i, b in enumerate(linkage.body)}
        self._centers = {b.name: b.center or (0.0, 0.0) for b in linkage.body}
        z = ca.SX.sym("z", self.n)
        self._z = z
        joints = {j.name: self._coordinate(j) for j in linkage.joint}
        rows = [row for j in linkage.joint for row in self._joint(j)]
        rows += [row for loop in linkage.loop for row in self._loop(loop)]
        start = dict(zip((j.name for j in linkage.joint), q0, strict=True))
        for gear in linkage.gear:
            a, b = gear.joints
            rows.append(joints[a] - start[a] - gear.ratio * (joints[b] - start[b]))
        phi, v = ca.vertcat(*rows), ca.SX.sym("v", self.n)
        W = ca.jacobian(phi, z)
        weights = [w for b in linkage.body for w in (b.mass, b.mass, b.inertia)]
        kinetic = 0.5 * ca.dot(ca.DM(weights), v**2)
        potential = self._potential(joints)
        w = ca.jtimes(W @ v, z, v)
        self._of = ca.Function(
            "of", [z, v], [W, w, -ca.gradient(potential, z), kinetic + potential]
        )
        self._M = np.diag(weights)
        self._joints = ca.Function("joints", [z], [ca.vertcat(*joints.values())])
        self._rates = ca.Function("rates", [z], [ca.jacobian(ca.vertcat(*joints.values()), z), W])
        self.z0 = self._start(q0)
        J, W0 = (np.array(m) for m in self._rates(self.z0))
        both, want = np.vstack([W0, J]), np.concatenate([np.zeros(len(W0)), qd0])
        self.v0 = np.linalg.lstsq(both, want, rcond=None)[0]

    def _frame(self, body):
        """Origin and angle of a body."""
        if body == "ground":
            return ca.SX(2, 1), ca.SX(0)
        i = self._at[body]
        angle = self._z[i + 2]
        return self._z[i : i + 2] - _turn(angle, self._centers[body]), angle

    def _point(self, body, at):
        origin, angle = self._frame(body)
        return origin + _turn(angle, at or (0.0, 0.0))

    def _apart(self, joint):
        child = self._point(joint.child, joint.at_child)
        return child - self._point(joint.parent, joint.at_parent)

    def _coordinate(self, joint):
        turned = self._frame(joint.child)[1] - self._frame(joint.parent)[1]
        if joint.type == "revolute":
            return turned
        along = _turn(self._frame(joint.parent)[1] + joint.axis, (1.0, 0.0))
        return ca.dot(along, self._apart(joint))

    def _joint(self, joint):
        apart = self._apart(joint)
        if joint.type == "revolute":
            return [apart[0], apart[1]]
        parent = self._frame(joint.parent)[1]
        across = _turn(parent + joint.axis, (0.0, 1.0))
        return [ca.dot(across, apart), self._frame(joint.child)[1] - parent]

    def _loop(self, loop):
        apart = self._point(loop.bodies[0], loop.at[0]) - self._point(loop.bodies[1], loop.at[1])
        if loop.type == "revolute":
            return [apart[0], apart[1]]
        angles = [self._frame(body)[1] for body in loop.bodies]
        across = _turn(angles[1] + loop.axis, (0.0, 1.0))
        rows = [ca.dot(across, apart)]
        if loop.type == "prismatic":
            rows.append(angles[0] - angles[1] - (loop.angle or 0.0))
        return rows

    def _potential(self, joints):
        V = ca.SX(0)
        gravity = self.linkage.gravity or (0.0, 0.0)
        for b in self.linkage.body:
            i = self._at[b.name]
            V -= b.mass * (gravity[0] * self._z[i] + gravity[1] * self._z[i + 1])
        for j in self.linkage.joint:
            V += 0.5 * (j.stiffness or 0.0) * (joints[j.name] - (j.rest or 0.0)) ** 2
        for s in self.linkage.spring:
            apart = self._point(s.bodies[0], s.at[0]) - self._point(s.bodies[1], s.at[1])
            V += 0.5 * s.stiffness * (ca.norm_2(apart) - (s.length or 0.0)) ** 2
        return V

    def _start(self, q0):
        found = poses(self.linkage, [q0])
        rows = []
        for b in self.linkage.body:
            x, y, angle = found[b.name][0]
            cx, cy = self._centers[b.name]
            c, s = np.cos(angle), np.sin(angle)
            rows += [x + c * cx - s * cy, y + s * cx + c * cy, angle]
        return np.array(rows)

    def _f(self, _t, y):
        z, v = y[: self.n], y[self.n :]
        W, w, Q, _ = (np.array(m) for m in self._of(z, v))
        m = len(W)
        K = np.block([[self._M, -W.T], [W, np.zeros((m, m))]])
        solved = np.linalg.solve(K, np.concatenate([Q.ravel(), -w.ravel()]))
        return np.concatenate([v, solved[: self.n]])

    def joints(self, t):
        """Joint coordinates at time t (s), (n,), and the energy gained since t = 0 (J)."""
        y0 = np.concatenate([self.z0, self.v0])
        y = solve_ivp(self._f, (0.0, t), y0, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        energy = [float(self._of(s[: self.n], s[self.n :])[3]) for s in (y0, y)]
        return np.array(self._joints(y[: self.n])).ravel(), energy[1] - energy[0]
