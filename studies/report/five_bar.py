"""The five-bar of Table 6.1 at a moving, closed pose: its terms by the project's components, to be
compared with the report's equations written out by hand (appendix_a.py)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.variables import parameters
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from studies.report import appendix_a

FRACTIONS = (0.3, 0.6, 0.45, 0.7)
"""f_i: not 1/2, or f and 1 - f could not be told apart."""
WRENCH = np.array(appendix_a.WRENCH)


@dataclass(frozen=True)
class Terms:
    """The terms of (2.3) to (5.11) at q (rad) and qd (rad/s) under the wrench of chapter 6."""

    D: Matrix
    C_qd: Vector
    W: Matrix
    w: Vector
    h: Vector
    x_h: Vector
    centers: Matrix
    J_h: Matrix
    energy: float
    Lambda_inv: Matrix
    open_Lambda_inv: Matrix
    qdd: Vector
    multipliers: Vector
    a_bias: Vector
    operations: dict[str, int]


def shipped() -> Linkage:
    """The five-bar of the shipped scene."""
    linkage = open_scene.load("five-bar").linkage
    assert linkage
    return linkage


class MovingFiveBar:
    """The shipped five-bar with other centres of mass, closed and moving as its loop allows."""

    def __init__(self) -> None:
        f, lengths = FRACTIONS, appendix_a.L
        linkage = shipped()
        bodies = tuple(
            replace(body, center=(f[i] * lengths[i], 0.0)) for i, body in enumerate(linkage.body)
        )
        point = replace(linkage.held, at=(f[1] * lengths[1], 0.0))
        self.linkage = replace(linkage, body=bodies, operational_point=point)
        q = np.array(appendix_a.Q0)
        for _ in range(6):
            q -= np.linalg.pinv(appendix_a.W(q)) @ appendix_a.h(q)
        self.q = q
        self.qd = np.linalg.svd(appendix_a.W(q))[2][2:].T @ (2.0, -1.0)

    @cached_property
    def terms(self) -> Terms:
        """By the components."""
        return self.at(self.q, self.qd)

    @cached_property
    def _function(self) -> tuple[ca.Function, list[str], Vector, dict[str, int]]:
        p = Signals("p", parameters(self.linkage))
        q, qd = ca.SX.sym("q", 4), ca.SX.sym("qd", 4)
        model = LinkageModel(self.linkage, p, q, qd)
        space = OperationalSpace(model)
        arm = LinkageModel(replace(self.linkage, loop=()), p, q, qd)
        qdd, multipliers = space.motion(model.J_h.T @ ca.DM(WRENCH))
        free, _ = OperationalSpace(arm).motion(arm.J_h.T @ ca.DM(WRENCH))
        found: dict[str, ca.SX] = {
            "D": model.D,
            "C_qd": model.C_qd,
            "W": model.W,
            "w": model.w,
            "h": model.h,
            "x_h": model.x_h,
            "centers": ca.horzcat(*model.centers.values()).T,
            "J_h": model.J_h,
            "energy": model.kinetic_energy,
            "Lambda_inv": space.Lambda_inv,
            "open_Lambda_inv": OperationalSpace(arm).Lambda_inv,
            "qdd": qdd,
            "multipliers": multipliers,
            "a_bias": space.a_bias,
        }
        counts = {
            "closed": ca.Function("f", [q, qd, p.vector], [qdd]).n_instructions(),
            "open": ca.Function("f", [q, qd, p.vector], [free]).n_instructions(),
            "Lambda_inv": ca.Function("f", [q, p.vector], [space.Lambda_inv]).n_instructions(),
        }
        function = ca.Function("f", [q, qd, p.vector], list(found.values()))
        return function, list(found), np.array(p.starts), counts

    def at(self, q: Vector, qd: Vector) -> Terms:
        """The terms at another state."""
        function, names, starts, counts = self._function
        values: dict[str, Any] = {}
        for name, value in zip(names, function(q, qd, starts), strict=True):
            array = np.array(value)
            flat = array.ravel() if 1 in array.shape else array
            values[name] = float(flat[0]) if name == "energy" else flat
        return Terms(**values, operations=counts)

    def slopes(self, name: str) -> Any:
        """Central differences of a term along each coordinate, (4, ...)."""
        step = 1e-6
        return np.array(
            [
                (
                    getattr(self.at(self.q + e, self.qd), name)
                    - getattr(self.at(self.q - e, self.qd), name)
                )
                / (2 * step)
                for e in step * np.eye(4)
            ]
        )

    def rate(self, name: str) -> Any:
        """A term's time derivative along the motion, at constant qd."""
        return np.tensordot(self.qd, self.slopes(name), 1)
