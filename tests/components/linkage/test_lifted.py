"""A planar linkage that is written in space costs the same operations, and gives the same bits."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.variables import parameters
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.orchestrator import open_scene

Z = (0.0, 0.0, 1.0)
OPERATIONS = {"five-bar": 487, "peaucellier": 1392, "n-four-bar": 826, "serial": 147}
"""Of the accelerations, as many as before linkages could be in space."""


def accelerations(linkage):
    """(q, qd, p) -> qdd and D, and the default parameters."""
    p, n = Signals("p", parameters(linkage)), len(linkage.coordinate_units)
    q, qd = ca.SX.sym("q", n), ca.SX.sym("qd", n)
    space = OperationalSpace(LinkageModel(linkage, p, q, qd))
    qdd = space.solver.follow(space.terms.efforts, -space.terms.w)
    results = [qdd, space.model.D]
    return [ca.Function("f", [q, qd, p.vector], [of], {"cse": True}) for of in results], p.starts


@pytest.mark.parametrize("scene", OPERATIONS)
def test_a_planar_linkage_in_space(scene):
    planar = open_scene.load(scene).linkage
    lifted = replace(planar, joint=tuple(replace(j, axis=Z) for j in planar.joint))
    assert (planar.dimension, lifted.dimension) == (2, 3)
    (flat, p), (deep, p_3) = accelerations(planar), accelerations(lifted)
    assert p == p_3
    n = len(planar.coordinate_units)
    assert flat[0].n_instructions() == OPERATIONS[scene]
    for f, g in zip(flat, deep, strict=True):
        assert f.n_instructions() == g.n_instructions()
        q, qd = np.random.default_rng(1).uniform(-2, 2, (2, n))
        assert (np.array(f(q, qd, p)) == np.array(g(q, qd, p))).all()
