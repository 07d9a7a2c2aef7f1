"""What a page draws of a frame: poses of the bodies and of the device's arms, and directions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from hapticlink.components.device.workspace import link_function
from hapticlink.components.linkage.poses import pose_function
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.results.mechanism_geometry import geometry


class Picture:
    """The picture of a scene; `shapes` are those of `mechanism_geometry`."""

    def __init__(
        self,
        linkage: Linkage,
        device: Device | None,
        contacts: Contacts | None,
        others: Mapping[str, Device] | None = None,
    ) -> None:
        self.shapes = geometry(linkage, contacts)
        self._names, self._poses = pose_function(linkage)
        self._arms = {"": link_function(device)} if device else {}
        self._arms |= {user: link_function(each) for user, each in (others or {}).items()}

    def drawn(self, frame: dict[str, Any]) -> dict[str, Any]:
        """The frame with `poses`, `ghost` by body's name, and of each user `arms` of the device and
        the constrained `directions` in the plane, in place of coordinates and projector."""
        shown = {k: v for k, v in self._of("", frame).items() if k not in ("q", "ghost")}
        for key, q in (("poses", frame["q"]), ("ghost", frame.get("ghost"))):
            if q is not None:
                found = np.asarray(self._poses(q)).T.tolist()
                shown[key] = dict(zip(self._names, found, strict=True))
        if others := frame.get("others"):
            shown["others"] = {user: self._of(user, found) for user, found in others.items()}
        return shown

    def _of(self, user: str, found: dict[str, Any]) -> dict[str, Any]:
        shown = {k: v for k, v in found.items() if k != "P_c"}
        if user in self._arms and "handle" in found:
            shown["arms"] = self.arms(found["handle"], user)
        if "P_c" in found:
            shown["directions"] = directions(found["P_c"])
        return shown

    def arms(self, handle: list[float], user: str = "") -> list[list[float] | None]:
        """Base joint, elbow and crank end of each arm of a user's device at a pose of the handle;
        none without a device."""
        if user not in self._arms or not handle:
            return []
        return _finite(np.asarray(self._arms[user](ca.DM(handle))).T.tolist())


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


def _finite(points: list[list[float]]) -> list[list[float] | None]:
    """Points with None where the device's arm does not reach, which JSON has no NaN for."""
    return [p if np.isfinite(p).all() else None for p in points]
