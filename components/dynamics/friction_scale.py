"""Stiffness and damping of joints that stick (friction.py), as large as a step can integrate.

With A the mobility of a joint at the start pose, with its loops closed but at least a quarter of
that with open loops, since it may be small there (at a dead centre), and N joints with friction f,
by default

    v_f = 4 N f A h,   d = 4 h v_f

for steps of h: all dampers together have a pole at 1/(4 h) or slower, and a joint that sticks has a
damping ratio of sqrt(f A d)/(2 v_f) = 1/2 for N = 1, as it has where only one of both is given and
this is not stiffer. So friction approaches Coulomb's law with h. Given values that an explicit
method cannot integrate at the start pose bound the step.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import casadi as ca

from hapticlink.components.dynamics.linkage_values import start_mobility
from hapticlink.components.forces.friction import LAG, rubbing
from hapticlink.components.linkage.joint_coordinates import JointCoordinate
from hapticlink.components.specs.linkage import Linkage

MIN_SPEED = 1e-9  # rad/s or m/s, of a default v_f
OPEN_SHARE = 0.25  # share of the mobility with open loops
STABLE = 2.0  # |pole| h up to which the explicit methods are stable


@dataclass(frozen=True)
class JointFriction:
    """A joint with friction: its mobility with closed loops, A, and N."""

    name: str
    joint: Any
    closed: float
    A: float
    N: int

    @property
    def poles(self) -> Iterator[tuple[str, float]]:
        """The poles (1/s) of a joint that sticks with the values that are given, each with them."""
        d, v_f = self.joint.friction_deflection, self.joint.friction_speed
        pull = (self.joint.friction or 0.0) * self.closed
        if v_f:
            yield f"joint `{self.name}`: `friction_speed` = {v_f!r}", pull / v_f
        if d:
            pole = max((pull / d) ** 0.5, (v_f or 0.0) / d)
            yield f"joint `{self.name}`: `friction_deflection` = {d!r}", pole

    def defaults(self, h: ca.SX) -> dict[str, ca.SX]:
        """v_f and d that are not given, by their names as parameters; if f is 0, which may be
        tuned, those for f = 1."""
        d, v_f = self.joint.friction_deflection, self.joint.friction_speed
        pull, values = (self.joint.friction or 1.0) * self.A, {}
        if v_f is None:
            v_f = ca.fmax(4 * self.N * pull * h, MIN_SPEED)
            v_f = v_f if d is None else ca.fmax(ca.fmin(v_f, d / h), (pull * d) ** 0.5)
            values[f"{self.name}.friction_speed"] = v_f
        if d is None:
            d = ca.fmax(LAG * h * v_f, v_f**2 / pull if pull else 0.0)
            values[f"{self.name}.friction_deflection"] = d
        return values


def scales(linkage: Linkage) -> list[JointFriction]:
    """The joints and cut joints with friction."""
    if not (rubs := rubbing(linkage)):
        return []
    return [
        JointFriction(j.name, j.joint, closed, max(closed, OPEN_SHARE * opened), len(rubs))
        for j, (closed, opened) in zip(rubs, _mobilities(linkage, rubs), strict=True)
    ]


def speeds(linkage: Linkage, h: float) -> dict[str, float]:
    """v_f (rad/s or m/s) by joint, for steps of h (s)."""
    speeds = {}
    for scale in scales(linkage):
        defaults = scale.defaults(ca.SX(h))
        given = scale.joint.friction_speed
        speeds[scale.name] = float(defaults.get(f"{scale.name}.friction_speed", given))
    return speeds


def longest_step(scales: Iterable[JointFriction]) -> float:
    """The longest step (s) in which explicit methods are stable with the values that are given."""
    fastest = max((pole for scale in scales for _, pole in scale.poles), default=0.0)
    return STABLE / fastest if fastest else math.inf


def require_slow(scales: Iterable[JointFriction], h: float) -> None:
    """Raises ValueError for given values that are too stiff for steps of h (s) of explicit
    methods."""
    for what, pole in (named_pole for scale in scales for named_pole in scale.poles):
        if pole * h > STABLE:
            raise ValueError(
                f"{what} makes a pole at {pole:.3g} 1/s, too fast for steps of {h:.3g} s: leave it "
                "out, take a larger one, a higher rate, more `mechanism.substeps`, or "
                "`mechanism.integrator` = 'linearly-implicit'"
            )


def _mobilities(linkage: Linkage, joints: list[JointCoordinate]) -> list[tuple[float, float]]:
    """Mobilities (1/kg or 1/(kg.m2)) of joints at the start pose, with closed and open loops."""
    closed, opened = start_mobility(
        linkage, lambda model: ca.vertcat(*(j.value(model) for j in joints))
    )
    both = zip(closed.diagonal(), opened.diagonal(), strict=True)
    return [(max(float(c), 0.0), float(o)) for c, o in both]
