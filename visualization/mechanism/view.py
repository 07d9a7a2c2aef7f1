"""How a picture is seen: by parallel projection onto a page.

The plane is seen along z. A linkage in space is turned a little about the vertical and seen from
above; up is against gravity, z without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.recorded_scene import scene_part

Matrix = NDArray[np.float64]
Direction = tuple[float, float, float]
TURNED, ABOVE = -0.6, 0.35
"""Angles (rad) by which a view in space is turned about the vertical, and looks down."""


@dataclass(frozen=True)
class View:
    """The vertical `up` and a horizontal direction `aside` (unit vectors), which is to the right
    on the page but for the angles (rad) by which the view is `turned` about the vertical, and looks
    down from `above`. browser_code/view.js has it, too."""

    aside: Direction = (1.0, 0.0, 0.0)
    up: Direction = (0.0, 1.0, 0.0)
    turned: float = 0.0
    above: float = 0.0
    dimension: int = 2
    """Of what is seen: 2 in the plane, 3 in space."""

    @cached_property
    def rows(self) -> Matrix:
        """Unit vectors to the right, up on the page, and to the eye, (3, 3)."""
        aside, up = np.array(self.aside), np.array(self.up)
        deep = np.cross(up, aside)
        c, s = np.cos(self.turned), np.sin(self.turned)
        right, away = c * aside + s * deep, c * deep - s * aside
        upward = np.cos(self.above) * up + np.sin(self.above) * away
        return np.array([right, upward, np.cross(right, upward)])


PLANE_VIEW = View()


def view_of_run(results: Results) -> View:
    """The view of the linkage of a run; that of the plane where there is none."""
    linkage = scene_part(results, "linkage", Linkage)
    return view_of(linkage) if linkage else PLANE_VIEW


def view_of(linkage: Linkage) -> View:
    """The view with which pictures of a linkage begin."""
    if linkage.dimension == 2:
        return PLANE_VIEW
    weight = np.array((*(linkage.gravity or (0.0, 0.0)), 0.0)[:3])
    up = -weight / np.linalg.norm(weight) if weight.any() else np.array([0.0, 0.0, 1.0])
    aside = np.roll(np.eye(3)[np.abs(up).argmax()], 1)
    aside = aside - up * (up @ aside)
    aside /= np.linalg.norm(aside)
    return View((*aside.tolist(),), (*(up + 0.0).tolist(),), TURNED, ABOVE, 3)
