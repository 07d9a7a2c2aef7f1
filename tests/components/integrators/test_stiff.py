"""L-stability of the linearly implicit method on a stiff joint, where explicit methods diverge."""

import numpy as np
import pytest

from hapticlink.components.specs.linkage import Body, Joint, Linkage, Mechanism, OperationalPoint
from tests.blocks import Running, virtual_mechanism


def after(integrator, steps, stiffness, damping):
    """Angle of a 1 kg m2 disc, from 0.1 rad towards its rest at 0.2, at 512 Hz."""
    linkage = Linkage(
        body=(Body(name="disc", mass=1.0, inertia=1.0),),
        joint=(Joint(name="axle", child="disc", stiffness=stiffness, damping=damping, rest=0.2),),
        operational_point=OperationalPoint(body="disc"),
        start={"axle": 0.1},
    )
    block = Running(virtual_mechanism(linkage, Mechanism(integrator=integrator), step_s=1 / 512))
    with np.errstate(all="ignore"):
        for _ in range(steps):
            block.step(1 / 512)
    return block.state["q"][0]


@pytest.mark.parametrize(("stiffness", "damping"), [(1e10, None), (1e8, 1e5), (1e6, 1e9)])
def test_stiff_modes_die_out_within_steps(stiffness, damping):
    """R(z) -> 0 for z -> infinity: undamped, oscillating and creeping springs alike."""
    left = after("linearly-implicit", 12, stiffness, damping) - 0.2
    # A spring that creeps (rate K/B = 1e-3/s) must stay where it is instead.
    goal = -0.1 * np.exp(-1e-3 * 12 / 512) if damping == 1e9 else 0.0
    assert left == pytest.approx(goal, abs=1e-6)


def test_explicit_methods_do_not_hold_it():
    assert not abs(after("rk4", 40, 1e8, 1e5)) < 1
