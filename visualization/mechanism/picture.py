"""What is drawn of a frame: poses of the bodies and of the devices' links, directions, forces in
cut joints, and what happens in it. All are CasADi functions of the raw signals, so that a page
without Python evaluates the same, as C."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from hapticlink.analysis.findings.episodes import FULL_TORQUE
from hapticlink.components.component import Signals
from hapticlink.components.device.motors_and_encoders import torque_function
from hapticlink.components.device.workspace import line_function
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import body_parameters, loop_name
from hapticlink.components.linkage.poses import pose_function
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.linkage import Linkage
from hapticlink.visualization.mechanism.mark_places import world
from hapticlink.visualization.mechanism.marks import full, marks, point_of, state
from hapticlink.visualization.mechanism.view import view_of

PORT = "user's port"
RAW = ("ghost", "q", "lambda", "P_c", "measured")
"""What frames have instead of what is drawn."""
LEAST_SHARE = 0.05
"""Of a constrained direction in the plane, below which it is a mere turn."""


class Part(NamedTuple):
    """A quantity that is drawn: `function` of the raw signals `needs` of a user, each a vector of
    `sizes`. Its result is a matrix with a column for each of `names`, or for each entry of a list
    without names; of a state, `gives` of `KINDS`, it is 1 while that holds."""

    user: str
    gives: str
    needs: tuple[str, ...]
    sizes: tuple[int, ...]
    function: ca.Function
    names: tuple[str, ...] = ()
    sparse: bool = False
    is_state: bool = False

    def value(self, found: Mapping[str, Any]) -> Any:
        """The quantity of a frame, in a JSON type."""
        given = zip(self.needs, self.sizes, strict=True)
        columns = np.asarray(self.function(*(found[name][:size] for name, size in given))).T
        if self.is_state:
            return bool(columns[0, 0])
        entries = [c.tolist() if np.isfinite(c).all() else None for c in columns]
        entries = [e for e in entries if e is None or any(e)] if self.sparse else entries
        return dict(zip(self.names, entries, strict=True)) if self.names else entries


class Picture:
    """The picture of a scene, of `marks`; devices: by user, the first one's name is empty. `parts`
    is what is computed of the raw signals."""

    def __init__(
        self,
        linkage: Linkage,
        devices: Mapping[str, Device],
        contacts: Contacts | None,
    ) -> None:
        self.marks, self.view = marks(linkage, contacts, devices), view_of(linkage)
        self._linkage, self._users = linkage, [*devices]
        names, poses = pose_function(linkage)
        n = poses.size1_in(0)
        self.parts = [
            Part("", gives, (q,), (n,), poses, tuple(names))
            for gives, q in (("poses", "q"), ("ghost", "ghost"))
        ]
        if linkage.loop:
            self.parts.append(_cut_joint_forces(linkage))
        ok, margin, gap = (ca.SX.sym(name) for name in ("branch_ok", "margin", "gap"))
        space, force = linkage.space, ca.SX.sym("F_env", linkage.space.size)
        touching = ca.logic_and(gap < 0, ca.norm_1(force) > 0)
        self.parts.append(_state("", "folded", {"branch_ok": ok}, ok == 0))
        ways = directions() if linkage.dimension == 2 else directions_in_space()
        for user in dict.fromkeys(("", *(point.name for point in linkage.point))):
            self.parts.append(
                Part(user, "directions", ("P_c",), (space.size**2,), ways, sparse=True)
            )
            self.parts.append(_state(user, "outside", {"margin": margin}, margin < 0))
            self.parts.append(_state(user, "contacts", {"gap": gap, "F_env": force}, touching))
        for user, device in devices.items():
            self.parts.append(
                Part(user, "arms", ("handle",), device.space.pose.shape, line_function(device))
            )
            self.parts.append(_is_saturated(user, device))

    def drawn(self, frame: dict[str, Any]) -> dict[str, Any]:
        """The frame with `poses`, `ghost` by body's name, forces in the `cut` joints, `states`, and
        of each user `arms` of the device and the constrained `directions` in the plane, in place of
        coordinates, multipliers and projector."""
        others = frame.get("others", {})
        shown = _without_raw(frame)
        if others:
            shown["others"] = {user: _without_raw(found) for user, found in others.items()}
        states = []
        for part in self.parts:
            found = others.get(part.user, {}) if part.user else frame
            if not {*part.needs} <= {*found}:
                continue
            value = part.value(found)
            if part.is_state:
                states += [state(part.gives, part.user)] if value else []
            else:
                (shown["others"][part.user] if part.user else shown)[part.gives] = value
        return shown | {"states": states}

    def at_rest(self, q: Any) -> dict[str, Any]:
        """A frame of the linkage at joint coordinates q, with each device at its user's point."""
        frame = self.drawn({"q": q})
        arms = {part.user: part for part in self.parts if part.gives == "arms"}
        for user in self._users:
            held = point_of(self._linkage, user)
            at = world(frame, held._replace(point=full(self._linkage, held.point)))
            pose = [*(at or ()), *frame["poses"][held.path[-1]][2:3]]  # of the plane with its angle
            drawn = arms[user].value({"handle": pose[: arms[user].sizes[0]]})
            (frame.setdefault("others", {}).setdefault(user, {}) if user else frame)["arms"] = drawn
        return frame


def _without_raw(values: Mapping[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in values.items() if k not in RAW}


def _cut_joint_forces(linkage: Linkage) -> Part:
    """The force (N) on the first body in each joint that is cut, (d, k): what the multipliers of
    its rows push the joint's point by, dh/dp' lambda. Moments have no arrow."""
    ends: list[Any] = [tuple(full(linkage, at) for at in loop.at) for loop in linkage.loop]
    lifted = (*(replace(o, at=at) for o, at in zip(linkage.loop, ends, strict=True)),)
    linkage = replace(linkage, loop=lifted, gear=())  # dh/dp in all directions, of the cut joints
    p = Signals("p", body_parameters(linkage))
    model = LinkageModel.symbolic(linkage, p)
    along, forces, row = ca.SX.sym("lambda", sum(model.rows)), [], 0
    for i, loop in enumerate(linkage.loop):
        h, R = model.closures[i].h, model.frames[loop.bodies[0]].rotation
        point, held = p[f"{loop_name(linkage, i)}.at1"], along[row : row + h.numel()]
        forces.append(ca.densify(R @ ca.jtimes(h, point, held, True)))
        row += h.numel()
    made = ca.Function("cut", [along, model.q, p.vector], [ca.horzcat(*forces)])
    cut = ca.Function("cut", [along, model.q], [made(along, model.q, p.starts)])
    return Part("", "cut", ("lambda", "q"), (along.numel(), model.q.numel()), cut)


def directions() -> ca.Function:
    """The constrained directions in the plane, (2, 2): unit vectors (x, y) times their share of the
    scaled direction (x, y, L theta), which span the projector P_c, (9,); zeros in place of those
    that are none, or a mere turn.

    With an orthonormal basis V (3, r) of its range P_c = V V', so that those with the main axes in
    the plane are the eigenvectors of the first two rows and columns of P_c times the roots of their
    eigenvalues, whatever the rank r.
    """
    p = ca.SX.sym("P_c", 9)
    a, b, d = p[0], p[1], p[4]
    mean, apart, angle = (a + d) / 2, ca.hypot((a - d) / 2, b), ca.atan2(2 * b, a - d) / 2
    axes = ca.vertcat(ca.cos(angle), ca.sin(angle)), ca.vertcat(-ca.sin(angle), ca.cos(angle))
    shares = (ca.sqrt(ca.fmax(mean + apart, 0)), ca.sqrt(ca.fmax(mean - apart, 0)))
    shown = [
        ca.if_else(share > LEAST_SHARE, share, 0) * axis
        for share, axis in zip(shares, axes, strict=True)
    ]
    return ca.Function("directions", [p], [ca.horzcat(*shown)])


def directions_in_space() -> ca.Function:
    """The constrained directions of a point in space, (3, 3): an orthonormal basis of the range of
    their projector P_c, (9,), and zeros, by Cholesky's decomposition with pivots."""
    p = ca.SX.sym("P_c", 9)
    rest, basis = ca.reshape(p, 3, 3), []
    for _ in range(3):
        longest = ca.mmax(ca.diag(rest))
        column = ca.SX(3, 1)
        for k in reversed(range(3)):  # the first of several that are as long
            column = ca.if_else(rest[k, k] >= longest, rest[:, k], column)
        is_one = longest > LEAST_SHARE
        way = ca.if_else(is_one, column / ca.sqrt(ca.if_else(is_one, longest, 1)), 0)
        basis.append(way)
        rest -= way @ way.T
    return ca.Function("directions", [p], [ca.densify(ca.horzcat(*basis))])


def _state(user: str, kind: str, needs: Mapping[str, ca.SX], holds: ca.SX) -> Part:
    """A state that `holds` or not by the signals that it needs."""
    function = ca.Function(kind, [*needs.values()], [holds])
    sizes = tuple(symbol.numel() for symbol in needs.values())
    return Part(user, kind, (*needs,), sizes, function, is_state=True)


def _is_saturated(user: str, device: Device) -> Part:
    """Whether a motor gives its largest torque."""
    force, pose = (ca.SX.sym(name, device.space.size) for name in ("F_motor", "measured"))
    limits = ca.DM([motor.torque_limit for motor in device.motors])
    loads = ca.norm_inf(torque_function(device)(force, pose) / limits)
    return _state(user, "saturated", {"F_motor": force, "measured": pose}, loads >= FULL_TORQUE)
