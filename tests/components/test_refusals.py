"""What a component, a linkage or a method is refused for: a row is what is made of it, the kind of
error, and what the message says of place, value and remedy."""

from dataclasses import replace

import pytest

import hapticlink as hl
from hapticlink.components.blocks.controller import controller
from hapticlink.components.blocks.hand import hand
from hapticlink.components.device import discretisation
from hapticlink.components.dynamics.assembly import AssemblyError
from hapticlink.components.dynamics.light_bodies import MasslessError
from hapticlink.components.integrators.runge_kutta import Tableau
from hapticlink.components.paths import TimeSpline, TimeTable, signal
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.control import Controller
from hapticlink.components.specs.hand import ArmHand, ProfileHand
from hapticlink.components.specs.linkage import Body, Joint, Limits, Linkage, OperationalPoint
from hapticlink.components.specs.paths import CoordinateSine
from studies.report.appendix_a import L
from tests.blocks import running
from tests.mechanisms import five_bar, four_bar, one_body, terms

BODY = Body(name="b", mass=1, inertia=1)
RING = Linkage(
    body=(Body(name="a", mass=1, inertia=1), BODY),
    joint=(Joint(name="ab", parent="b", child="a"), Joint(name="ba", parent="a", child="b")),
    operational_point=OperationalPoint(body="a"),
)
MASSLESS_LINKS = {"m": (1, 0, 0, 0), "I": (1e-4, 0, 0, 0)}
"""Two links of a five-bar, which has two freedoms."""
PASSIVE = {"integrator": "passive-midpoint"}
REFUSED = [
    # blocks
    (lambda: controller(Controller(impedance=False, bias="full"), PLANE, L), ValueError,
     r"controller\.bias.*controller\.impedance"),
    (lambda: hand(ProfileHand(table=((1.0, 0, 0, 0), (0.0, 0, 0, 0)))), ValueError,
     r"hand\.table.*row 2 at t = 0\.0 s"),
    (lambda: hand(ArmHand(target=())), ValueError, r"hand\.target.*no rows"),
    (lambda: discretisation.weight("tustin"), ValueError,
     r"'tustin'.*forward, backward, trapezoidal"),
    # linkages
    (lambda: running(five_bar(l=(0.042, 0.042, 0.0184, 0.2))), AssemblyError,
     r"loop `loop1` \(link2 to link4\).*0\.\d+ m are left"),
    (lambda: terms(RING, "x_h"), ValueError, "no chain of joints leads to `ground`"),
    (lambda: running(one_body(BODY, type="free", limits=Limits(lower=0.0, stiffness=1.0))),
     ValueError, "limits act on one coordinate"),
    (lambda: running(one_body(BODY, type="free", damping=1.0)), ValueError,
     "one coordinate and a free joint has three"),
    (lambda: running(five_bar(**MASSLESS_LINKS)), MasslessError,
     r"body `link[234]` has mass and inertia 0"),
    (lambda: running(replace(four_bar((1.0, 0.0, 1.0)), loop=())), MasslessError,
     "body `coupler` has mass and inertia 0"),
    (lambda: Body(name="point", mass=1.0), ValueError, "give its `inertia`"),
    (lambda: hl.scene("slider-crank", {"linkage.joint.0.ports": ["effort"]}), hl.InputFault,
     "effort is the drive's constant already"),
    (lambda: hl.scene("single-body", {"linkage.joint.0.ports": ["position"]}), hl.InputFault,
     "a free joint has three"),
    # methods
    (lambda: running(five_bar(), integrator="euler"), ValueError,
     r"no integrator .euler.; there are .*rk4"),
    (lambda: running(five_bar(), step_s=None, stabilization="baumgarte", **PASSIVE), ValueError,
     "projection"),
    (lambda: running(five_bar(), step_s=None, frame_s=1 / 30, **PASSIVE), ValueError,
     "local_model"),
    (lambda: Tableau(((0.0,), (0.5,)), (0.0, 1.0), (0.0, 0.5), 1), ValueError,
     "an explicit method has"),
    (lambda: Tableau(((),), (0.0, 1.0), (0.0, 0.5), 1), ValueError, "an explicit method has"),
    (lambda: Tableau(((), (0.5,)), (0.0, 1.0), (0.5,), 1), ValueError, "an explicit method has"),
    # signals
    (lambda: TimeTable((), "x"), ValueError, "`x`: the table has no rows"),
    (lambda: TimeTable(((0.0,), (1.0,)), "x"), ValueError, "at least one value beside its time"),
    (lambda: TimeTable(((0.0, 1.0), (0.0, 2.0)), "x"), ValueError,
     r"`x`: row 2 at t = 0.0 s does not come after 0.0 s"),
    (lambda: TimeTable(((0.0, 1.0), (1.0, float("nan"))), "x"), ValueError,
     r"`x`: row 2 is .*finite"),
    (lambda: TimeSpline(((0.0, 0.0), (1e-200, 1.0), (1.0, 0.0)), "x"), ValueError,
     "`x`: no spline through rows so close"),
    (lambda: signal(CoordinateSine(amplitude=1.0, frequency=1.0), "spline", "x"), ValueError,
     "`x`: a sine has no rows: give rows, or leave `interpolation` out"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "kind", "message"), REFUSED)
def test_what_is_refused(make, kind, message):
    with pytest.raises(kind, match=message):
        make()
