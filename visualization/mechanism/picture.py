"""What is drawn of a frame: poses of the bodies and of the devices' arms, directions, forces in cut
joints, and what happens in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from hapticlink.analysis.findings.limits import FULL_TORQUE, NOTICEABLE_J
from hapticlink.components.device.numeric_torques import torque_function
from hapticlink.components.device.workspace import link_function
from hapticlink.components.linkage.poses import pose_function
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.linkage import Linkage
from hapticlink.visualization.mechanism.marks import marks, point_of, reach, state

PORT = "user's port"
RAW = ("ghost", "q", "lambda", "P_c", "F_motor", "measured")
"""What frames have instead of what is drawn."""


class Picture:
    """The picture of a scene, of `marks`; devices: by user, the first one's name is empty."""

    def __init__(
        self,
        linkage: Linkage,
        devices: Mapping[str, Device],
        contacts: Contacts | None,
    ) -> None:
        self.marks = marks(linkage, contacts, devices)
        self._linkage = linkage
        self._names, self._poses = pose_function(linkage)
        self._arms = {user: link_function(device) for user, device in devices.items()}
        self._limits = {
            user: (torque_function(device), FULL_TORQUE * device.torque_limit)
            for user, device in devices.items()
        }

    def drawn(self, frame: dict[str, Any]) -> dict[str, Any]:
        """The frame with `poses`, `ghost` by body's name, forces in the `cut` joints, `states`, and
        of each user `arms` of the device and the constrained `directions` in the plane, in place of
        coordinates, multipliers and projector."""
        shown = self._of("", frame)
        states = [*self._states("", frame)]
        for key, q in (("poses", frame["q"]), ("ghost", frame.get("ghost"))):
            if q is not None:
                found = np.asarray(self._poses(q)).T.tolist()
                shown[key] = dict(zip(self._names, found, strict=True))
        if "lambda" in frame:
            shown["cut"] = self._cut(frame["lambda"], shown["poses"])
        if others := frame.get("others"):
            shown["others"] = {user: self._of(user, found) for user, found in others.items()}
            states += [each for user, found in others.items() for each in self._states(user, found)]
        return shown | {"states": states}

    def at_rest(self, q: Any) -> dict[str, Any]:
        """A frame of the linkage at joint coordinates q, with each device at its user's point."""
        frame = self.drawn({"q": q})
        for user in self._arms:
            (_, body), (px, py) = point_of(self._linkage, user)
            x, y, angle = frame["poses"][body]
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            arms = self._arms_at(user, [*(np.array([x, y]) + turn @ (px, py)), angle])
            (frame.setdefault("others", {}).setdefault(user, {}) if user else frame)["arms"] = arms
        return frame

    def _of(self, user: str, values: dict[str, Any]) -> dict[str, Any]:
        shown = {k: v for k, v in values.items() if k not in RAW}
        if user in self._arms and "handle" in values:
            shown["arms"] = self._arms_at(user, values["handle"])
        if "P_c" in values:
            shown["directions"] = directions(values["P_c"])
        return shown

    def _states(self, user: str, values: Mapping[str, Any]) -> list[str]:
        """The kinds of `KINDS` that a frame shows by itself."""
        kinds = {
            "folded": reach(values, ("branch_ok", 0)) == 0,
            "saturated": self._saturated(user, values),
            "energy": (reach(values, ("energy", PORT)) or 0.0) > NOTICEABLE_J,
            "contacts": (reach(values, ("gap", 0)) or 0.0) < 0 and any(values.get("F_env", ())),
            "outside": (reach(values, ("margin", 0)) or 0.0) < 0,
        }
        return [state(kind, user) for kind, holds in kinds.items() if holds]

    def _saturated(self, user: str, values: Mapping[str, Any]) -> bool:
        if user not in self._limits or not {"F_motor", "measured"} <= {*values}:
            return False
        torques, most = self._limits[user]
        return bool(ca.norm_inf(torques(values["F_motor"], values["measured"])) >= most)

    def _cut(self, multipliers: list[float], poses: dict[str, list[float]]) -> list[list[float]]:
        """The force (N) in each joint that is cut. It has two multipliers, a slot one; that of what
        slides is along the normal, and a moment has no arrow."""
        forces, row = [], 0
        for loop in self._linkage.loop:
            normal = poses[loop.bodies[1]][2] + (loop.axis or 0.0)
            along = multipliers[row]
            revolute = loop.type == "revolute"
            forces.append(
                multipliers[row : row + 2]
                if revolute
                else [-along * float(np.sin(normal)), along * float(np.cos(normal))]
            )
            row += 1 if loop.type == "slot" else 2
        return forces

    def _arms_at(self, user: str, handle: list[float]) -> list[list[float] | None]:
        """Base joint, elbow and crank end of each arm of a user's device at a pose of the handle,
        None where the arm does not reach, which JSON has no NaN for."""
        points = np.asarray(self._arms[user](ca.DM(handle))).T.tolist()
        return [p if np.isfinite(p).all() else None for p in points]


def directions(P_c: list[float]) -> list[list[float]]:
    """The constrained directions in the plane, unit vectors (x, y) times their share of the scaled
    direction (x, y, L theta): eigenvectors of the projector P_c, (9,), to the eigenvalue 1. A
    direction that is a mere turn has no share."""
    values, vectors = np.linalg.eigh(np.array(P_c).reshape(3, 3))
    plane = vectors[:2, values > 0.5].T
    if len(plane) > 1:  # any basis spans them: take the one with the main axes in the plane
        _, sizes, axes = np.linalg.svd(plane)
        plane = sizes[:, None] * axes[: len(sizes)]
    return [v.tolist() for v in plane if np.linalg.norm(v) > 0.05]
