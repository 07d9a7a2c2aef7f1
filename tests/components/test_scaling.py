"""Lengths in any unit: millimetres to kilometres give the same motion.

With every length times s, masses alike and inertias times s^2, equal angles and rates mean equal
angular accelerations under a wrench (s F, s F, s^2 M); Lagrange multipliers are times s, and the
closures, scaled, stay on the same rounding. Dimensional analysis; no joint slides.
"""

from dataclasses import replace

import casadi as ca
import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mechanisms import linkages

from hapticlink.components.component import Signals
from hapticlink.components.linkage import LinkageModel, parameters
from hapticlink.components.operational_space import OperationalSpace


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


def terms(linkage, q, qd, F):
    """(qdd, lambda, Lambda^-1, W)."""
    variables = parameters(linkage)
    p, n = Signals("p", variables), len(q)
    symbols = ca.SX.sym("q", n), ca.SX.sym("qd", n)
    model = LinkageModel(linkage, p, *symbols)
    space = OperationalSpace(model)
    qdd, multipliers = space.motion(model.J_h.T @ ca.DM(F))
    f = ca.Function("f", [*symbols, p.vector], [qdd, multipliers, space.Lambda_inv, model.W])
    values = f.call([ca.DM(q), ca.DM(qd), ca.DM([s for v in variables for s in v.starts])])
    return [np.array(v) for v in values]


@settings(max_examples=60, deadline=None)
@given(linkages(max_bodies=7, prismatic=False), st.floats(-3, 3), st.integers(0, 2**31))
def test_units_of_length_do_not_matter(drawn, exponent, seed):
    linkage, q, qd = drawn
    s, F = 10.0**exponent, np.random.default_rng(seed).normal(size=3)
    qdd, multipliers, mobility, W = terms(linkage, q, qd, F)
    if linkage.loop:
        singular = np.linalg.svd(W, compute_uv=False)
        assume(singular.min() > 1e-2 * singular.max())
    there = terms(scaled(linkage, s), q, qd, F * (s, s, s**2))
    S = np.diag([1, 1, s])
    tight = {"rtol": 0, "atol": 1e-10}
    size = np.abs(qdd).max(initial=1.0)
    np.testing.assert_allclose(there[0] / size, qdd / size, **tight)
    size = np.abs(multipliers).max(initial=1.0)
    np.testing.assert_allclose(there[1] / s / size, multipliers / size, **tight)
    size = np.abs(mobility).max(initial=1e-3)  # a locked body's is rounding alone, of 1/kg
    np.testing.assert_allclose(S @ there[2] @ S / size, mobility / size, **tight)
