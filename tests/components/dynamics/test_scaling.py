"""Lengths in any unit: millimetres to kilometres give the same motion.

With every length times s, masses alike and inertias times s^2, equal angles and rates mean equal
angular accelerations under a wrench (s F, s F, s^2 M); Lagrange multipliers, and what joints that
slide do, are times s. Dimensional analysis.
"""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.components.dynamics.operational_space import OperationalSpace
from tests.mechanisms import evaluated, linkages


def scaled(linkage, s):
    """The linkage with every length times s."""

    def point(at):
        return None if at is None else (s * at[0], s * at[1])

    op = linkage.operational_point
    return replace(
        linkage,
        body=tuple(
            replace(b, inertia=b.inertia * s**2, center=point(b.center)) for b in linkage.body
        ),
        joint=tuple(
            replace(j, at_parent=point(j.at_parent), at_child=point(j.at_child))
            for j in linkage.joint
        ),
        loop=tuple(replace(p, at=tuple(map(point, p.at))) for p in linkage.loop),
        operational_point=replace(op, at=point(op.at)),
    )


def solution(model, F):
    """(qdd, lambda, Lambda^-1) under a wrench of the hand."""
    space = OperationalSpace(model)
    return *space.motion(model.J_h.T @ F), space.Lambda_inv


@settings(max_examples=40)
@given(linkages(), st.floats(-3, 3), st.integers(0, 2**31))
def test_units_of_length_do_not_matter(drawn, exponent, seed):
    linkage, q, qd = drawn
    s, F = 10.0**exponent, np.random.default_rng(seed).normal(size=3)
    unit = np.array([s if j.type == "prismatic" else 1.0 for j in linkage.joint])
    at = evaluated(linkage, solution, (3,))
    qdd, multipliers, mobility = at(q, qd, F)
    there = at(unit * q, unit * qd, F * (s, s, s**2), of=scaled(linkage, s))
    S = np.diag([1, 1, s])
    tight = {"rtol": 0, "atol": 1e-10}
    size = np.abs(qdd).max(initial=1.0)
    np.testing.assert_allclose(there[0].ravel() / unit / size, qdd.ravel() / size, **tight)
    size = np.abs(multipliers).max(initial=1.0)
    np.testing.assert_allclose(there[1] / s / size, multipliers / size, **tight)
    size = np.abs(mobility).max(initial=1e-3)  # a locked body's is rounding alone, of 1/kg
    np.testing.assert_allclose(S @ there[2] @ S / size, mobility / size, **tight)
