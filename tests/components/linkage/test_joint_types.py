from typing import get_args

import casadi as ca
import numpy as np
import pytest

from hapticlink.components.component import Signals
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import body_parameters
from hapticlink.components.specs.joint_types import JOINT_TYPES, CutType, TreeType
from hapticlink.components.specs.linkage import Body, Joint, Linkage, OperationalPoint


def test_every_type_of_a_scene_has_its_record() -> None:
    assert {*get_args(TreeType), *get_args(CutType)} == {*JOINT_TYPES}
    assert all(not JOINT_TYPES[name].free for name in get_args(CutType))
    assert {name: kind.rows for name, kind in JOINT_TYPES.items()} == {
        "revolute": 2, "prismatic": 2, "slot": 1, "free": 0,
    }  # fmt: skip


@pytest.mark.parametrize("kind", JOINT_TYPES)
def test_the_twists_of_a_joint_are_the_rates_of_its_frame(kind: str) -> None:
    """(omega, v) of the child's point by differences of its frame, on a parent that is turned."""
    joints = (
        Joint(name="base", child="a"),
        Joint(name="j", type=kind, parent="a", child="b", at_parent=(0.3, 0.1), axis=0.7),
    )
    body = {"mass": 1.0, "inertia": 1.0}
    linkage = Linkage(
        body=(Body(name="a", **body), Body(name="b", **body)),
        joint=joints,
        operational_point=OperationalPoint(body="b"),
    )
    p = Signals("p", body_parameters(linkage))
    model = LinkageModel.symbolic(linkage, p)
    pivot, twists = model.twists(joints[1])
    frame = model.frames["b"]
    values = [pivot, frame.origin, frame.angle, ca.horzcat(*twists)]
    function = ca.Function("frame", [model.q, p.vector], values)

    def at(q: np.ndarray) -> list[np.ndarray]:
        return [np.array(value) for value in function(q, p.starts)]

    q = np.r_[0.4, np.linspace(0.2, 0.6, JOINT_TYPES[kind].size)]
    point, origin, _, S = at(q)
    assert point == pytest.approx(origin, abs=1e-15)
    for i in range(JOINT_TYPES[kind].size):
        step = 1e-6 * np.eye(len(q))[1 + i]
        ends = [np.vstack(at(q + sign * step)[2:0:-1]) for sign in (1, -1)]
        assert S[:, [i]] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-9)
