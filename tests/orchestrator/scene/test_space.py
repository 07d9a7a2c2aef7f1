"""What a linkage in space is refused for, each by a change of a scene that is read."""

import pytest

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.scene import read_and_check
from tests.spatial_linkages import BALL_AND_SLIDER

SCENE = f'title = "A bar on a ball, and a slider"\nduration = 0.1\n{BALL_AND_SLIDER}'
ROD = (
    "linkage.loop.+={ type = 'rod', bodies = ['bar', 'block'], "
    "at = [[0, 0, 0.1], [0.3, 0, 0]], length = 0.31622776601683794%s }"
)
CUT = "linkage.loop.+={ bodies = ['bar', 'block'], at = [[0, 0, 0], [0, 0, 0]]%s }"
HOOKE = "linkage.joint.ball={ name = 'ball', type = 'universal', child = 'bar'%s }"
DEVICE = (
    "device={ body = [{ name = 'a', mass = 1, inertia = 1 }], handle = { body = 'a' }, %s, "
    "joint = [{ name = 'j', child = 'a', axis = [0, 0, 0] }] }"
)
REFUSED = [
    ("linkage.joint.slide.axis=[0, 0, 0]", "linkage.joint[1] (slide).axis: [0.0, 0.0, 0.0] has no"),
    ("linkage.joint.slide.axis=0.5", "an angle is of the plane: give three numbers as axis"),
    ("linkage.joint.ball.axis=[0, 0, 1]", "a spherical joint has no axis: take it out"),
    ("linkage.joint.ball.second_axis=[0, 0, 1]", "has no second axis: take it out"),
    ("linkage.joint.ball.type=free", "a free joint is of the plane: take one of revolute"),
    ("linkage.start.ball=[0.1, 0.2]", "a spherical joint takes three numbers"),
    (HOOKE % "", "a universal joint needs both its axes: give `axis` and `second_axis`"),
    (HOOKE % ", axis = [1, 0, 0], second_axis = [2, 0, 0]", "is parallel to `axis`: give two"),
    (CUT % ", axes = [[0, 0, 1], [0, 0, 0]]", "has no length: give a direction"),
    (CUT % ", type = 'universal'", "needs both its axes: give `axes`"),
    (CUT % ", damping = 1.0", "damping: acts on a joint of the tree in space: cut the loop at"),
    (CUT % ", type = 'slot'", "a slot joint is of the plane: take one of revolute, prismatic, uni"),
    (CUT % ", type = 'rod'", "a rod joint needs its length (m)"),
    (CUT % ", axis = 0.1", "an angle is of the plane: give three numbers as axes"),
    (CUT % ", type = 'prismatic', angle = 0.1", "in space the frames become parallel"),
    ("linkage.body.bar.inertia=[0.1, 0.02, 0.02]", "no body has the principal moments 0.02, 0.02,"),
    ("linkage.body.bar.radius=0.1", "is a shape of the plane, and in space nothing touches"),
    ("hand={ type = 'arm', target = [[0, 0, 0, 0]] }", "hand.mass: the default is of the plane"),
    ("device={}", "device: is of the plane, and a spherical joint put the linkage in space: take"),
    ("device={ extends = 'ideal-3', handle = { angle = 'free' } }", "of three forces: take it out"),
    (
        DEVICE % "loop = [{ bodies = ['a', 'ground'], at = [[0, 0], [0, 0]] }]",
        'in space take "spherical"',
    ),
    (DEVICE % "base = [0, 0, 1]", "device.joint[0] (j).axis: [0.0, 0.0, 0.0] has no length"),
    ("contacts={ stiffness = 1e3 }", "are of the plane, and a spherical joint put the linkage in"),
    ("local_model=true", "local_model: is of the plane: leave it out"),
]


def test_the_scene_itself_is_read():
    linkage = open_scene.load(read_and_check.read_scene(SCENE, [ROD % ""])).linkage
    assert linkage.dimension == 3
    assert linkage.coordinate_units == ("rad", "rad", "rad", "m")


@pytest.mark.parametrize(("option", "message"), REFUSED)
def test_refused(option, message):
    with pytest.raises(InputFault) as refused:
        read_and_check.read_scene(SCENE, [option])
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("option", "cause"),
    [
        ("linkage.gravity=[0.0, -9.81, 0.0]", "three numbers of gravity"),
        ("linkage.body.link1.inertia=[1e-4, 1e-4, 1e-4]", "three numbers of inertia"),
        ("linkage.operational_point.at=[0.02, 0.0, 0.0]", "three numbers of at of a point"),
    ],
)
def test_a_planar_scene_is_told_what_put_it_in_space(option, cause):
    with pytest.raises(InputFault) as refused:
        open_scene.load("closed-loop-ideal", [option])
    assert f"device: is of the plane, and {cause} put the linkage in space" in str(refused.value)
    assert 'take one in space, extends = "ideal-3", or take it out' in str(refused.value)


def test_a_device_in_space_does_not_render_a_planar_linkage():
    with pytest.raises(InputFault) as refused:
        open_scene.load("closed-loop-ideal", ["device.extends=ideal-3"])
    said = "device: is in space, by three numbers of axis, and the linkage is of the plane: take a"
    assert said in str(refused.value)


def test_gains_of_the_plane_are_no_defaults_in_space():
    with pytest.raises(InputFault) as refused:
        read_and_check.read_scene(SCENE, ["device.extends=ideal-3", "controller={}"])
    said = "controller.teleoperation.stiffness: the default is of the plane, with a moment: give th"
    assert said in str(refused.value)
