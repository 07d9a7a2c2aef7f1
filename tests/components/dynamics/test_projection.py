"""Projection onto the closures: where it ends, and that it moves no further than it must."""

import casadi as ca
import numpy as np

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.articulated_body import TreeInertia
from hapticlink.components.dynamics.projection import projection
from hapticlink.components.dynamics.variables import parameters
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Mechanism
from tests.blocks import Running, virtual_mechanism
from tests.components import appendix_a
from tests.mechanisms import TABLE_6_1, five_bar


def test_pose_and_rate_end_on_the_closures_by_the_nearest_way():
    """A five-bar 1e-4 rad off its closure at rates that tear it apart; D and W of appendix A. The
    way is that of the pose where it began, hence nearest but for its 1e-4."""
    linkage = five_bar()
    signals = Signals("p", parameters(linkage))
    model = LinkageModel(linkage, signals, ca.SX.sym("q", 4), ca.SX.sym("qd", 4))
    p = [s for variable in signals.variables for s in variable.starts]
    project = projection(model, TreeInertia(model))
    h = ca.Function("h", [model.q, model.p.vector], [model.h])
    q = Running(virtual_mechanism(linkage, Mechanism(), step_s=1e-3)).state["q"]
    off = q + 1e-4 * np.array([1.0, -1.0, 0.5, 2.0])
    torn = np.array([3.0, -1.0, 2.0, -2.0])
    found, rate = (np.array(x).ravel() for x in project(off, torn, p))
    assert np.abs(np.array(h(found, p))).max() < 1e-15
    W = appendix_a.W(found, TABLE_6_1["l"])
    assert np.abs(W @ torn).max() > 0.1
    assert np.abs(W @ rate).max() < 1e-8
    # In the metric of D the change has no part along the motions that the closures allow.
    free = np.linalg.svd(W)[2][2:]
    D = appendix_a.D(found, TABLE_6_1["m"], TABLE_6_1["l"], TABLE_6_1["I"], (0.5,) * 4)
    change = D @ (rate - torn)
    assert np.abs(free @ change).max() < 1e-3 * np.abs(change).max()
