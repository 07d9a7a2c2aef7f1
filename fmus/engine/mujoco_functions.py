"""The functions of a block by MuJoCo, in the place of a component's (`python_slave.py`).

Its text is copied into the FMU's resources/; it needs mujoco and numpy. The state is
x = (q, qd, number of constrained directions of each point), so that every function is one of its
arguments alone. With M the engine's mass matrix, W and J the Jacobians of the closures and of a
point, and A a the accelerations that the closures allow,

    A Q        = M^-1 (Q - W' (W M^-1 W')^+ W M^-1 Q)
    Lambda^-1  = J A J'                                           (B.13)
    a_bias     = J (A (f - M a_W) + a_W) + Jdot qd,   W a_W = -Wdot qd

The rule behind P_c and n_constraints is that of `constrained_directions.py`. A copy that is placed
(graphics.sync = "exact") has the mechanism's coordinates, projected once on the closures as the
engine sees them; one that is pulled, and a mechanism, take steps of the engine.
"""

from __future__ import annotations

import json
import os
import typing

import mujoco
import numpy as np

Array = typing.Any
LOCKED, RANK = 1e-10, 1e-6
"""As in `constrained_directions.py` and `equivalent_wrench.py`."""
SINGULAR = 1e-12
"""Share of the largest eigenvalue of W M^-1 W' below which a closure is redundant."""
BAD = {
    mujoco.mjtWarning.mjWARN_BADQPOS: "coordinate",
    mujoco.mjtWarning.mjWARN_BADQVEL: "rate",
    mujoco.mjtWarning.mjWARN_BADQACC: "acceleration",
    mujoco.mjtWarning.mjWARN_BADCTRL: "wrench",
}
mujoco.set_mju_user_warning(lambda text: None)  # else it writes a file in the current folder
PUSHING = (
    mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT,
    mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS,
    mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL,
    mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC,
)


def functions(resources: str) -> dict:
    """The functions of an instance, by the names that the slave knows."""
    engine = Engine(resources)
    return {name: getattr(engine, name) for name in ("initialize", "output", "advance", "substep")}


class _Point:
    """An operational point: its port prefix, site, hinges up to its body, and actuators."""

    def __init__(self, model: Array, name: str, prefix: str, hinges: list) -> None:
        self.prefix, self.site = prefix, model.site(name).id
        self.body = int(model.site_bodyid[self.site])
        self.angle = [int(model.joint(hinge).qposadr[0]) for hinge in hinges]
        parts = [f"{name}.{axis}" for axis in ("x", "y", *(["theta"] if hinges else []))]
        self.actuators = [model.actuator(part).id for part in parts]


class Engine:
    """A model with its data, and the block's ports by name."""

    def __init__(self, resources: str) -> None:
        with open(os.path.join(resources, "engine.json"), encoding="utf-8") as file:
            about = json.load(file)
        self._about = about
        self._m = mujoco.MjModel.from_xml_path(os.path.join(resources, "model.xml"))
        self._d = mujoco.MjData(self._m)
        # MuJoCo's coordinate of each of the linkage's; all joints have one.
        self._order = [int(self._m.joint(name).qposadr[0]) for name in about["coordinates"]]
        self._n = len(self._order)
        self._points = [_Point(self._m, *point) for point in about["points"]]
        self._counted = [p for p in self._points if f"{p.prefix}P_c" in about["outputs"]]
        self._loops = [
            [self._m.site(f"loop{i}.{k}").id for k in (0, 1)] for i in range(about["loops"])
        ]
        self._gears = [
            ([int(self._m.joint(name).qposadr[0]) for name in joints], ratio, offset)
            for joints, ratio, offset in about["gears"]
        ]
        self._soften()

    def _soften(self) -> None:
        """Contacts and limits give as the scene's stiffness k and damping b do for the two bodies'
        mass m: time constant 2 m/b, damping ratio b / (2 sqrt(k m)); MuJoCo lengthens time
        constants below two of its steps."""
        m, (k, b) = self._m, self._about["contact"]
        for i in range(m.npair):
            bodies = (m.geom_bodyid[geom] for geom in (m.pair_geom1[i], m.pair_geom2[i]))
            # MuJoCo takes the mean over three axes, along one of which nothing moves here.
            mass = 1 / sum(1.5 * m.body_invweight0[body][0] for body in bodies)
            m.pair_solref[i] = _solref(k, b, mass)
        for name, k, b in self._about["limits"]:
            joint = m.joint(name)
            mass = 1 / m.dof_invweight0[joint.dofadr[0]]
            m.jnt_solref[joint.id] = _solref(k, b, mass)

    # --- the functions ------------------------------------------------------------------------

    def initialize(self, u: Array, p: Array, x: Array) -> None:
        named = self._named("parameters", p)
        self._place(named["q_start"], named["qd_start"])
        for _ in range(3):
            self._project()
        if "branch_ok" in self._about["outputs"]:
            self._branch = _pivots(self._closures())
        self._store(x, named, np.zeros(len(self._counted)))

    def substep(self, x: Array, u: Array, p: Array, t: Array, h: Array, after: Array) -> None:
        self._step(x, u, p, h)
        after[:] = x
        after[: 2 * self._n] = _doubles(self._d.qpos[self._order], self._d.qvel[self._order])

    def advance(  # the slave's signature
        self,
        x: Array,
        u: Array,
        p: Array,
        t: Array,
        h: Array,
        end: Array,
        z: Array,
        after: Array,
        y: Array,
        next_z: Array,
    ) -> None:
        self._step(x, u, p, h)
        self._store(after, self._named("parameters", p), np.array(x[2 * self._n :]))
        self.output(after, u, p, end, y, next_z)

    def output(self, x: Array, u: Array, p: Array, t: Array, y: Array, z: Array) -> None:
        inputs, named = self._named("inputs", u), self._named("parameters", p)
        self._place(x[: self._n], x[self._n : 2 * self._n])
        values: dict[str, Array] = {"q": x[: self._n], "qd": x[self._n : 2 * self._n]}
        if self._about["block"] == "virtual_mechanism":
            self._push(inputs)
            mujoco.mj_forward(self._m, self._d)
            values |= self._dynamics(inputs, named)
        else:
            self._positions()
        solve, minv = self._closed()
        for point in self._points:
            values |= self._at(point, solve, minv, named, x)
        if "closure_error" in self._about["outputs"]:
            gaps = [self._gap(loop) for loop in self._loops]
            values["closure_error"] = max([0.0, *(float(np.linalg.norm(gap)) for gap in gaps)])
        if "branch_ok" in self._about["outputs"]:
            values |= self._assembly(values["q"], inputs["q_ref"])
        start = 0
        for name, size in self._about["outputs"].items():
            y[start : start + size] = _doubles(values[name])
            start += size

    # --- motion -------------------------------------------------------------------------------

    def _place(self, q: Array, qd: Array) -> None:
        self._d.qpos[self._order], self._d.qvel[self._order] = q, qd

    def _positions(self) -> None:
        mujoco.mj_fwdPosition(self._m, self._d)
        mujoco.mj_comVel(self._m, self._d)

    def _step(self, x: Array, u: Array, p: Array, h: Array) -> None:
        inputs, named = self._named("inputs", u), self._named("parameters", p)
        if self._about["sync"] == "exact":
            self._place(inputs["q_ref"], inputs["qd_ref"])
            self._project()
            return
        self._place(x[: self._n], x[self._n : 2 * self._n])
        self._m.opt.timestep = h[0]
        if self._about["block"] == "virtual_mechanism":
            self._push(inputs)
        else:
            self._pull(inputs, named)
        mujoco.mj_step(self._m, self._d)
        if bad := [BAD[kind] for kind in BAD if self._d.warning[kind].number]:
            mujoco.mj_resetData(self._m, self._d)
            raise ValueError(f"MuJoCo finds a huge or undefined {bad[0]}: take a smaller step")

    def _pull(self, inputs: dict, named: dict) -> None:
        """The graphics controller K_g (x_ref - x) + B_g (v_ref - v) at the operational point, with
        x and v at the end of the step: soft equalities with the regularisation

            R = 1 / (h (B_g + h K_g)),   a_ref = -R (K_g (x - x_ref - B_g/K_g v_ref)) - v/h

        An explicit force would need a step below twice the inertia by B_g."""
        m, d, h = self._m, self._d, self._m.opt.timestep
        K, B = named["K_g"], named["B_g"]
        target = inputs["x_ref"] + B / K * inputs["v_ref"]
        d.mocap_pos[0, :2] = target[:2]
        mujoco.mj_fwdPosition(m, d)
        for name, i in (("pull.place", 0), ("pull.angle", 2)):
            pull = m.equality(name).id
            row = np.flatnonzero((d.efc_id == pull) & (d.efc_type == 0))[0]
            had = d.efc_KBIP[row, 2]
            mobility = d.efc_R[row] * had / (1 - had)  # by which MuJoCo scales the impedance
            R = 1 / (h * (B[i] + h * K[i]))
            impedance = 1 / (1 + R / mobility)
            impedance = min(max(impedance, 1e-4), 1 - 1e-4)  # MuJoCo's own bounds
            m.eq_solimp[pull] = impedance, impedance, 1.0, 0.5, 2.0
            m.eq_solref[pull] = -K[i] * R * impedance, -impedance / h
            if name == "pull.angle":
                m.eq_data[pull, 0] = target[2]

    def _push(self, inputs: dict) -> None:
        for point in self._points:
            wrench = self._wrench(point, inputs)
            self._d.ctrl[point.actuators] = wrench[: len(point.actuators)]

    def _wrench(self, point: _Point, inputs: dict) -> Array:
        """What hand and virtual coupling do to the linkage at a point."""
        drift = inputs.get(f"{point.prefix}F_drift", np.zeros(3))
        return inputs[f"{point.prefix}F_hand"] - drift

    def _project(self) -> None:
        """q and qd onto the closures, by the smallest change of kinetic energy."""
        self._positions()
        if not self._loops and not self._gears:
            return
        W, minv = self._closures(), self._inverse_mass()
        gaps = [self._gap(loop) for loop in self._loops]
        gaps += [self._gear_gap(gear) for gear in self._gears]
        self._d.qpos[:] -= _back(W, minv) @ np.concatenate(gaps)
        self._positions()
        W, minv = self._closures(), self._inverse_mass()
        self._d.qvel[:] -= _back(W, minv) @ (W @ self._d.qvel)

    def _store(self, x: Array, named: dict, before: Array) -> None:
        """The engine's q and qd, with the constrained directions counted there, into x."""
        x[: 2 * self._n] = _doubles(self._d.qpos[self._order], self._d.qvel[self._order])
        if not self._counted:
            return
        self._positions()
        solve, minv = self._closed()
        for i, point in enumerate(self._counted):
            values, _, least = self._scaled(point, solve, minv, named)
            share = np.where(np.arange(3) < before[i], named["hysteresis"], 1.0)
            share = named["rank_tolerance"] * share * values[-1]
            x[2 * self._n + i] = float(np.sum(values < np.maximum(share, least)))

    # --- what the engine knows at a pose ---------------------------------------------------------

    def _inverse_mass(self) -> Array:
        M = np.zeros((self._m.nv, self._m.nv))
        mujoco.mj_fullM(self._m, self._d, M)
        return np.linalg.inv(M)

    def _jacobian(self, site: int, dot: bool = False) -> Array:
        """(x, y, theta) of a site by q, 3 x n; with `dot`, its rate."""
        linear, angular = np.zeros((3, self._m.nv)), np.zeros((3, self._m.nv))
        if dot:
            place, body = self._d.site_xpos[site], self._m.site_bodyid[site]
            mujoco.mj_jacDot(self._m, self._d, linear, angular, place, int(body))
        else:
            mujoco.mj_jacSite(self._m, self._d, linear, angular, site)
        return np.vstack((linear[:2], angular[2:]))

    def _closures(self, dot: bool = False) -> Array:
        rows = [(self._jacobian(a, dot) - self._jacobian(b, dot))[:2] for a, b in self._loops]
        for (first, second), ratio, _ in self._gears:
            row = np.zeros((1, self._m.nv))
            if not dot:
                row[0, first], row[0, second] = 1.0, -ratio
            rows.append(row)
        return np.vstack(rows) if rows else np.zeros((0, self._m.nv))

    def _gap(self, loop: list) -> Array:
        return (self._d.site_xpos[loop[0]] - self._d.site_xpos[loop[1]])[:2]

    def _gear_gap(self, gear: tuple) -> Array:
        (first, second), ratio, offset = gear
        return np.array([self._d.qpos[first] - ratio * self._d.qpos[second] - offset])

    def _closed(self) -> tuple:
        """A and M^-1 at the pose."""
        W, minv = self._closures(), self._inverse_mass()
        back = minv @ W.T
        return minv - back @ _pseudo_inverse(W @ back) @ back.T, minv

    def _scaled(self, point: _Point, solve: Array, minv: Array, named: dict) -> tuple:
        """Eigenvalues, eigenvectors of S Lambda^-1 S, and the eigenvalue below which the closures
        lock a direction."""
        S, J = np.diag([1.0, 1.0, named["length_scale"]]), self._jacobian(point.site)
        values, vectors = np.linalg.eigh(S @ J @ solve @ J.T @ S)
        return values, vectors, LOCKED * np.trace(S @ J @ minv @ J.T @ S)

    def _at(self, point: _Point, solve: Array, minv: Array, named: dict, x: Array) -> dict:
        """The outputs of a point that its pose and velocity give."""
        J, prefix = self._jacobian(point.site), point.prefix
        place, angle = self._d.site_xpos[point.site], self._d.qpos[point.angle].sum()
        values = {"x": [place[0], place[1], angle], "v": J @ self._d.qvel}
        values["Lambda_inv"] = J @ solve @ J.T
        if point in self._counted:
            count = x[2 * self._n + self._counted.index(point)]
            _, vectors, _ = self._scaled(point, solve, minv, named)
            chosen = vectors[:, : round(count)]
            values |= {"P_c": chosen @ chosen.T, "n_constraints": count}
        return {f"{prefix}{name}": value for name, value in values.items()}

    def _dynamics(self, inputs: dict, named: dict) -> dict:
        """The outputs that forces give, after mj_forward."""
        d, (solve, minv) = self._d, self._closed()
        values: dict[str, Array] = {"qdd": d.qacc[self._order]}
        pushing = np.isin(d.efc_type, PUSHING)
        pushed = d.efc_J.reshape(-1, self._m.nv)[pushing].T @ d.efc_force[pushing]
        drawn = {p.prefix: self._jacobian(p.site).T @ self._wrench(p, inputs) for p in self._points}
        free = d.qacc_smooth - minv @ sum(drawn.values())
        W = self._closures()
        free = free - _back(W, minv) @ (W @ free + self._closures(dot=True) @ d.qvel)
        for point in self._points:
            J = self._jacobian(point.site)
            others = sum(Q for name, Q in drawn.items() if name != point.prefix)
            bias = J @ free + self._jacobian(point.site, dot=True) @ d.qvel
            values[f"{point.prefix}a_bias"] = bias
            if f"{point.prefix}F_env" in self._about["outputs"]:
                Q = pushed + (others if self._about["felt"] else 0)
                wrench = self._equivalent(point, solve, minv, named, J @ solve @ Q)
                values[f"{point.prefix}F_env"] = wrench
        gaps = [contact.dist for contact in d.contact[: d.ncon]]
        values["contact_gap"] = min([self._about["margin"], *gaps])
        return values

    def _equivalent(self, point: _Point, solve: Array, minv: Array, named: dict, a: Array) -> Array:
        """The wrench of least scaled norm with Lambda^-1 F = a (`equivalent_wrench.py`)."""
        S = np.diag([1.0, 1.0, named["length_scale"]])
        values, vectors, least = self._scaled(point, solve, minv, named)
        mobile = values > max(RANK * values[-1], least)
        inverse = np.where(mobile, 1 / np.where(mobile, values, 1), 0)
        return S @ (vectors @ (inverse * (vectors.T @ (S @ a))))

    def _assembly(self, q: Array, q_ref: Array) -> dict:
        """Whether the minor of W that fixes the dependent coordinates at the start has the sign
        that it has at q_ref, and the distance from q_ref."""
        signs = []
        for pose in (q_ref, q):
            self._place(pose, np.zeros(self._n))
            self._positions()
            signs.append(np.linalg.det(self._closures()[np.ix_(*self._branch)]))
        error = np.linalg.norm(np.array(q_ref) - np.array(q))
        return {"branch_ok": float(signs[0] * signs[1] >= 0), "q_error": error}

    def _named(self, kind: str, flat: Array) -> dict:
        """The entries of a flat array by port; a scalar as a number."""
        values, start = {}, 0
        for name, size in self._about[kind].items():
            values[name] = np.array(flat[start : start + size]) if size > 1 else flat[start]
            start += size
        return values


def _solref(k: float, b: float, mass: float) -> tuple:
    return (2 * mass / b, b / (2 * (k * mass) ** 0.5)) if b else (-k / mass, 0.0)


def _back(W: Array, minv: Array) -> Array:
    """M^-1 W' (W M^-1 W')^+, by which velocities are brought back onto closures."""
    return minv @ W.T @ _pseudo_inverse(W @ minv @ W.T)


def _pseudo_inverse(A: Array) -> Array:
    return np.linalg.pinv(A, SINGULAR, hermitian=True) if A.size else A


def _pivots(W: Array) -> tuple:
    """Rows and columns of a regular minor of W of full rank, by complete pivoting."""
    A, rows, columns = W.copy(), [], []
    most = np.abs(A).max()
    while np.abs(A).max() > 1e-9 * most:
        i, j = np.unravel_index(np.abs(A).argmax(), A.shape)
        rows.append(int(i))
        columns.append(int(j))
        A = A - np.outer(A[:, j], A[i]) / A[i, j]
    return rows, columns


def _doubles(*values: Array) -> Array:
    flat = np.concatenate([np.ravel(np.asarray(v, dtype=float)) for v in values])
    return flat.data
