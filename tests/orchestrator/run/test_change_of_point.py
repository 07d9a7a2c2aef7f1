"""A scene in which the hand lets go of a link and holds another."""

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.changes_of_point import changes_of_point, describe_changes
from hapticlink.analysis.findings.tracking import pose_error
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.orchestrator.base.errors import SceneFault
from tests.orchestrator.run.test_apply_timed_events import vectors

SCENE = "closed-loop-ideal"
POINTS = {
    "linkage.points": {
        "middle": {"body": "link2", "at": [0.021, 0.0]},
        "other": {"body": "link4", "at": [0.02, 0.0]},
    },
    "linkage.operational_point": "middle",
    "controller.topology": False,
    "duration": 0.5,
}
LETS_GO = 0.25
CHANGE = {"at": [{"time": LETS_GO, "set": {"linkage.operational_point": "other"}}]}
K = np.array([100.0, 100.0, 0.5])  # of F_drift, by default


@pytest.fixture(scope="module")
def changed():
    return hl.run(SCENE, POINTS | CHANGE)


def test_until_the_change_the_run_is_that_of_the_point_alone(changed):
    alone = hl.run(SCENE, {name: POINTS[name] for name in ("controller.topology", "duration")})
    rows = alone.haptics["time"] <= LETS_GO
    for name in alone.haptics:
        np.testing.assert_array_equal(changed.haptics[name][rows], alone.haptics[name][rows], name)


def test_the_coupling_is_off_until_the_copy_has_the_other_point_and_then_relaxed(changed):
    haptics, graphics = changed.haptics, changed.graphics
    time, held = haptics["time"], haptics["virtual_mechanism.held_point"]
    free = held == 0
    ready = graphics["time"][graphics["virtual_environment.ready_point"] == 2]
    grasp = time[time >= ready[0]][0]  # takes effect in the step from there on
    np.testing.assert_array_equal(free, (time > LETS_GO) & (time <= grasp))
    for name in ("controller.F_drift", "hand.F"):
        assert not vectors(haptics, name)[free].any()
    first = np.flatnonzero(time == grasp)[0] + 1
    x_S, v_S = (vectors(haptics, f"virtual_mechanism.{name}")[first] for name in ("x", "v"))
    x_D = vectors(haptics, "haptic_device.x")[first - 1]
    # The rest is the motion of the link in the step since the grasp.
    assert np.abs(x_S - x_D - v_S / 512).max() < 0.2 * np.abs(v_S / 512).max()


def test_no_energy_is_made_by_a_change_and_what_the_coupling_loses_is_told(changed):
    port = user_port(changed)
    assert np.abs(port.blocks_J["mechanism"]).max() < 1e-8  # all that it has, wrenches brought it
    held = changed.haptics["virtual_mechanism.held_point"]
    free = np.flatnonzero(held == 0)
    row = free[0] - 1
    e = (
        vectors(changed.haptics, "virtual_mechanism.x")
        - vectors(changed.haptics, "haptic_device.x")
    )[row]
    let_go, grasped = changes_of_point(changed)
    assert let_go[:3] == (LETS_GO, "middle", "none")
    assert let_go.stored == pytest.approx(e @ (K * e) / 2, rel=1e-12)
    assert (grasped.before, grasped.after, grasped.stored) == ("none", "other", 0.0)
    told = [*describe_changes(changed)]
    assert told[0].endswith("mJ stored in the coupling are lost")
    assert told[1].startswith("the hand took hold of other at ")
    generated = port.generated_J[free]
    assert np.ptp(generated) < 1e-9  # while it holds nothing
    assert len(pose_error(changed).time_s) == (held > 0).sum()


def test_of_two_links_the_other_is_pushed_from_the_change_on(tmp_path):
    text = """title = "Two links"
duration = 0.5
[linkage]
operational_point = "inner"
start = { shoulder = 0.3, elbow = 0.7 }
points.inner = { body = "upper", at = [0.15, 0.02] }
points.outer = { body = "lower", at = [0.2, 0.0] }
body = [
  { name = "upper", mass = 0.6, inertia = 3e-3, center = [0.1, 0.0] },
  { name = "lower", mass = 0.4, inertia = 2e-3, center = [0.1, 0.0] },
]
joint = [
  { name = "shoulder", child = "upper" },
  { name = "elbow", parent = "upper", child = "lower", at_parent = [0.25, 0.0] },
]
[hand]
wrench = [0.5, 0.2, 0.01]
"""
    path = tmp_path / "arm.toml"
    path.write_text(text)
    event = {"time": 0.25, "set": {"linkage.operational_point": "outer"}}
    run = hl.run(path, {"at": [event]}).haptics
    q, qd = ([run[f"virtual_mechanism.{n}[{i}]"] for i in (1, 2)] for n in ("q", "qd"))
    row, names = 128, ("shoulder", "elbow")
    assert run["time"][row] == event["time"]
    begin = {f"linkage.start.{n}": float(v[row]) for n, v in zip(names, q, strict=True)}
    begin |= {f"linkage.start_velocity.{n}": float(v[row]) for n, v in zip(names, qd, strict=True)}
    from_there = hl.run(path, begin | {"linkage.operational_point": "outer", "duration": 0.25})
    for i, moved in enumerate(q, 1):
        found = from_there.haptics[f"virtual_mechanism.q[{i}]"]
        np.testing.assert_allclose(moved[row:], found, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"linkage.operational_point": "tip"}, "no point 'tip'; there are middle, other"),
        ({"linkage.operational_point": {"body": "link2"}}, "give one of linkage.points"),
        ({"linkage.points.other.body": "rod"}, "linkage.points.other.body: no body 'rod'"),
        ({"linkage.points": {"none": {"body": "link2"}}}, "'none': a name of letters"),
        ({"graphics.sync": "operational"}, "nothing pulls the copy while the hand holds no point"),
        ({"at": [{"time": 0, "set": {"linkage.operational_point": "tip"}}]}, "no point 'tip'"),
    ],
)
def test_points_that_are_not_there_are_refused(options, said):
    with pytest.raises(SceneFault, match=said):
        hl.run(SCENE, POINTS | options)


def test_points_have_their_numbers_in_whatever_order_a_scene_names_them(changed):
    points = POINTS["linkage.points"]
    turned = POINTS | {"linkage.points": {name: points[name] for name in reversed(points)}}
    asked = hl.run(
        SCENE, turned | {"at": [{"time": LETS_GO, "set": {"virtual_mechanism.point": 2}}]}
    )
    for name in changed.haptics:
        np.testing.assert_array_equal(changed.haptics[name], asked.haptics[name], name)


def test_a_change_needs_points_with_names():
    with pytest.raises(SceneFault, match=r"\[linkage\.points\.NAME\]"):
        hl.run(SCENE, {"duration": 0.1} | CHANGE)
