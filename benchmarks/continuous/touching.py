"""Contact forces of capsules at fixed discs and polygons, from distances.

Places as in `contacts.pairs`: a disc's centre at each capsule's axis, each end of an axis at a
polygon's boundary, and each corner of a polygon at the axis. With the gap g along the unit vector n
from the obstacle to the axis

    F = n max(0, -k g - b g')  where g < 0;   the wrench on a body is (F, r x F), r to the axis

(the surface point differs from that of the axis by a multiple of n, which changes neither g' nor
r x F). Axes stay outside of the obstacles: contacts deeper than a capsule's radius are not known.
"""

from __future__ import annotations

import numpy as np

from benchmarks.maximal import Bodies, turned
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Linkage


class Touching:
    """The contacts of a linkage; none where `contacts` is None. Raises ValueError for an enclosure,
    friction, and bodies that touch each other."""

    def __init__(self, linkage: Linkage, contacts: Contacts | None, bodies: Bodies) -> None:
        self._n = 3 * len(linkage.body)
        self._contacts = contacts
        if contacts is None:
            return
        if contacts.enclosure or contacts.friction is not None or linkage.free:
            raise ValueError("contacts: the reference knows capsules, fixed discs and polygons")
        shaped = [(i, b) for i, b in enumerate(linkage.body) if len(b.shape) == 2]
        self._body = np.array([i for i, _ in shaped])
        self._axes = np.array([[bodies.end(b.name, at)[1] for at in b.shape] for _, b in shaped])
        self._radius = np.array([b.radius for _, b in shaped])
        discs = [(disc.center, disc.radius) for disc in contacts.disc]
        corners = [(corner, 0.0) for polygon in contacts.polygon for corner in polygon.corners]
        self._points = np.array([at for at, _ in (*discs, *corners)])
        self._extra = np.array([radius for _, radius in (*discs, *corners)])
        self._edges = [
            (np.array(p.corners), np.roll(np.array(p.corners), -1, axis=0))
            for p in contacts.polygon
        ]

    def forces(self, z: np.ndarray, zd: np.ndarray) -> np.ndarray:
        """Forces on the bodies' centres, (3n,)."""
        found = np.zeros(self._n)
        if self._contacts is None:
            return found
        pose, rate = z.reshape(-1, 3)[self._body], zd.reshape(-1, 3)[self._body]
        axes = pose[:, None, :2] + turned(pose[:, None, 2], self._axes)
        on = _nearest(self._points[None], axes[:, None, 0], axes[:, None, 1])
        self._push(found, pose, rate, on, on - self._points, self._extra)
        for a, b in self._edges:
            at = _nearest(axes[:, :, None], a, b)
            away = axes[:, :, None] - at
            least = np.argmin(np.linalg.norm(away, axis=-1), axis=-1)[..., None, None]
            away = np.take_along_axis(away, least, axis=2)[:, :, 0]
            self._push(found, pose, rate, axes, away, 0.0)
        return found

    def _push(
        self,
        found: np.ndarray,
        pose: np.ndarray,
        rate: np.ndarray,
        on: np.ndarray,
        away: np.ndarray,
        extra: np.ndarray | float,
    ) -> None:
        """Add the forces at points `on` of the axes (capsules, places, 2), `away` from obstacles
        that are thicker by `extra` (m)."""
        distance = np.linalg.norm(away, axis=-1)
        normal = away / distance[..., None]
        gap = distance - self._radius[:, None] - extra
        if (gap >= 0).all():
            return
        arm = on - pose[:, None, :2]
        turning = arm[..., 0] * normal[..., 1] - arm[..., 1] * normal[..., 0]
        closing = np.einsum("kpi,ki->kp", normal, rate[:, :2]) + turning * rate[:, None, 2]
        assert self._contacts
        k, b = self._contacts.stiffness, self._contacts.damping
        F = np.where(gap < 0, np.maximum(0.0, -k * gap - b * closing), 0.0)
        wrench = np.concatenate([F[..., None] * normal, (F * turning)[..., None]], axis=-1)
        found.reshape(-1, 3)[self._body] += wrench.sum(axis=1)


def _nearest(at: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The points of segments a b nearest to `at`, (..., 2)."""
    span = b - a
    s = np.sum((at - a) * span, -1) / np.sum(span * span, -1)
    return a + np.clip(s, 0.0, 1.0)[..., None] * span
