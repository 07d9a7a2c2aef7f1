from dataclasses import replace
from typing import Any, get_args

import casadi as ca
import numpy as np
import pytest

from benchmarks.peers.comparable import require_comparable
from hapticlink.components.component import Signals
from hapticlink.components.contact.broad_phase import reach
from hapticlink.components.dynamics.light_bodies import smallest_inertia
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import body_parameters
from hapticlink.components.specs.joint_types import (
    AXIS,
    JOINT_TYPES,
    CutType,
    Freedom,
    JointType,
    TreeType,
)
from hapticlink.components.specs.linkage import Body, Joint, Linkage, Loop, OperationalPoint
from hapticlink.fmus.engine.mjcf import mjcf
from hapticlink.fmus.errors import FmuError
from hapticlink.orchestrator import open_scene
from tests.mechanisms import terms
from tests.reference.absolute_coordinates import Absolute

BODY = {"mass": 1.0, "inertia": 1.0}
PLANAR = [name for name, kind in JOINT_TYPES.items() if kind.in_plane]


def test_every_type_of_a_scene_has_its_record() -> None:
    assert {*get_args(TreeType), *get_args(CutType)} == {*JOINT_TYPES}
    assert all(not JOINT_TYPES[name].free for name in get_args(CutType))


@pytest.mark.parametrize("kind", [name for name in get_args(CutType) if name in PLANAR])
def test_a_cut_joint_has_a_row_for_each_motion_that_it_takes(kind: str) -> None:
    """As many independent rows as the rank of W, here between two free bodies."""
    linkage = Linkage(
        body=(Body(name="a", **BODY), Body(name="b", **BODY)),
        joint=(Joint(name="ja", type="free", child="a"), Joint(name="jb", type="free", child="b")),
        loop=(Loop(type=kind, bodies=("a", "b"), at=((0.3, 0.1), (0.2, 0.0)), axis=0.7),),
        operational_point=OperationalPoint(body="b"),
    )
    (W,) = terms(linkage, "W")(np.linspace(0.2, 0.7, 6), np.zeros(6))
    assert np.linalg.matrix_rank(W) == len(W) == JOINT_TYPES[kind].rows()


@pytest.mark.parametrize("kind", get_args(TreeType))
def test_the_smallest_inertia_at_a_coordinate(kind: str) -> None:
    """1/(D^-1)_ii of a body on the ground, the least over its poses: a bound of what turns and
    slides at once."""
    body = Body(name="b", mass=2.0, inertia=0.3, center=(0.4, 0.1))
    axis: dict[str, Any] = {"axis": 0.7}
    if kind not in PLANAR:
        body = replace(body, inertia=(0.3, 0.4, 0.25), center=(0.4, 0.1, -0.2))
        axis = {"axis": (0.3, 0.2, 0.9), "second_axis": (0.8, 0.1, 0.0)}
    joint = Joint(name="j", type=kind, child="b", at_child=(-0.1, 0.2), **axis)
    linkage = Linkage(body=(body,), joint=(joint,), operational_point=OperationalPoint(body="b"))
    n, of = joint.kind.size, terms(linkage, "D")
    widest = 4.0 / np.sqrt(3.0) if joint.kind.balls else 3.0
    q = np.random.default_rng(3).uniform(-widest, widest, (2000, n))
    found = np.min([1.0 / np.diag(np.linalg.inv(of(each, each)[0])) for each in q], axis=0)
    least = np.array(smallest_inertia(joint, body))
    assert (least <= found * (1 + 1e-12)).all()
    if kind in PLANAR and all(freedom.pure for freedom in joint.kind.freedoms):
        assert least == pytest.approx(found, rel=1e-4)


def test_a_motion_that_turns_and_slides_at_once_is_no_turn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As of a wheel on a rack: its reach has no bound, and what knows turns and slides refuses."""
    rolls = JointType((Freedom(turns=True, along="axis"),), "pin", (AXIS,))
    monkeypatch.setitem(JOINT_TYPES, "prismatic", rolls)
    joint = Joint(name="j", type="prismatic", child="b", axis=0.7)
    linkage = Linkage(
        body=(Body(name="b", **BODY, radius=0.1, capsule=((0.0, 0.0),)),),
        joint=(joint,),
        operational_point=OperationalPoint(body="b"),
    )
    model = LinkageModel.symbolic(linkage, Signals("p", body_parameters(linkage)))
    _, (twist,) = model.twists(joint)
    values = ca.Function("twist", [model.p.vector], [twist])(model.p.starts)
    assert np.array(values).ravel() == pytest.approx([1.0, np.cos(0.7), np.sin(0.7)])
    assert reach(linkage, "b")[1] == np.inf
    with pytest.raises(FmuError, match="'j' turns and slides at once"):
        mjcf(linkage)
    with pytest.raises(ValueError, match="a prismatic joint is not compared"):
        require_comparable(linkage)


@pytest.mark.parametrize("scene", ["scotch-yoke", "pendulum", "geared-five-bar"])
def test_what_converters_would_leave_out_is_not_compared(scene: str) -> None:
    linkage = open_scene.load(scene).linkage
    with pytest.raises(ValueError, match="compared"):
        require_comparable(linkage)


def test_equations_of_the_reference_are_those_of_known_types() -> None:
    linkage = open_scene.load("single-body").linkage
    with pytest.raises(ValueError, match="write the equations of a free joint here"):
        Absolute(linkage, np.zeros(3), np.zeros(3))


@pytest.mark.parametrize("kind", PLANAR)
def test_the_twists_of_a_joint_are_the_rates_of_its_frame(kind: str) -> None:
    """(omega, v) of the child's point by differences of its frame, on a parent that is turned."""
    joints = (
        Joint(name="base", child="a"),
        Joint(name="j", type=kind, parent="a", child="b", at_parent=(0.3, 0.1), axis=0.7),
    )
    linkage = Linkage(
        body=(Body(name="a", **BODY), Body(name="b", **BODY)),
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
