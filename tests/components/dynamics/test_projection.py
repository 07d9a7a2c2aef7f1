"""Projection onto the closures: where it ends, and that it moves no further than it must."""

import numpy as np

from hapticlink.components.dynamics.articulated_body import TreeInertia
from hapticlink.components.dynamics.projection import projection
from studies.report import appendix_a
from tests.blocks import running
from tests.mechanisms import evaluated, five_bar


def test_pose_and_rate_end_on_the_closures_by_the_nearest_way():
    """A five-bar 1e-4 rad off its closure at rates that tear it apart; D and W of appendix A. The
    way is that of the pose where it began, hence nearest but for its 1e-4."""
    linkage = five_bar()

    def projected(model):
        return projection(model, TreeInertia(model))(model.q, model.qd, model.p.vector)

    off = running(linkage).state["q"] + 1e-4 * np.array([1.0, -1.0, 0.5, 2.0])
    torn = np.array([3.0, -1.0, 2.0, -2.0])
    q, rate = (x.ravel() for x in evaluated(linkage, projected)(off, torn))
    (h,) = evaluated(linkage, lambda model: [model.h])(q, torn)
    assert np.abs(h).max() < 1e-15
    W = appendix_a.W(q)
    assert np.abs(W @ torn).max() > 0.1
    assert np.abs(W @ rate).max() < 1e-8
    # In the metric of D the change has no part along the motions that the closures allow.
    free = np.linalg.svd(W)[2][2:]
    change = appendix_a.D(q) @ (rate - torn)
    assert np.abs(free @ change).max() < 1e-3 * np.abs(change).max()
