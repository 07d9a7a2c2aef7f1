"""Devices with fewer motors than directions on the report's five-bar: what is felt, and what is
said."""

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.measures import Measures
from hapticlink.analysis.findings.rendered import describe_devices, describe_rendered
from hapticlink.analysis.findings.summary import lines, numbers
from hapticlink.analysis.search.acceptance import energy_share, judged_numbers
from hapticlink.analysis.sweep.row import METRIC
from hapticlink.components.specs.device import Handle
from hapticlink.orchestrator.results.read_results import load
from hapticlink.orchestrator.results.recorded_scene import described_devices
from hapticlink.visualization.figures import run_figures
from tests.little_fmus import entries, slave
from tests.shared_fixtures import run_once


@pytest.mark.parametrize(
    ("handle", "said"),
    [
        (Handle(body="b"), ""),
        (Handle(body="b", angle="free"), "renders forces, no moments: its handle is a point"),
        (Handle(body="b", angle="fixed"), "no moments: it holds the handle's angle"),
        (Handle(body="b", angle="free", along=(0.0, 1.0)), "forces along (0, 1) alone"),
    ],
)
def test_what_a_device_renders_follows_from_its_handle(handle, said):
    described = describe_rendered(handle)
    assert described == "" if not said else said in described


def test_a_moment_that_reaches_nothing_is_told_where_there_is_one():
    for moment, angle, said in ((0.1, "free", True), (0.0, "free", False), (0.1, "held", False)):
        device = {"handle": {"body": "b", "angle": angle}, "body": [{"mass": 1.0}]}
        scene = {"device": device, "hand": {"wrench": (1.0, 0.0, moment)}}
        assert any("0.1 N.m, reaches nothing" in line for line in describe_devices(scene)) == said


def test_velocity_terms_are_compensated_by_default_for_a_light_device_alone():
    keys = {"controller": {}, "hand": {"type": "constant", "wrench": [0.0, 0.0, 0.0]}}
    for name, own, bias in (
        ("2diy", {}, "full"),
        ("2diy", {"bias": "none"}, "none"),
        ("2diy", {"impedance": False}, None),
        ("twin", {}, None),
    ):
        options = keys | {"controller": own, "device.extends": name, "sensing": "ideal"}
        scene = hl.scene("single-body", options)
        assert scene.all_controllers[""].bias == bias
        said = "weighs 0.101 kg" in "\n".join(describe_devices(scene.tables()))
        assert said == (name == "2diy" and not own)


def test_the_kit_s_pantograph_follows_the_point_and_no_moment_crosses():
    """.5 mm with ideal sensing; the handle's angle is that of the start, and is compared with
    nothing; hand and coupling have no moment."""
    found = run_once("closed-loop-2diy", [])
    assert found.record.end.reason == "duration"
    row = judged_numbers(found)
    assert row[METRIC] <= 0.5
    assert row["theta_max_rad"] == 0.0
    assert np.ptp(found.haptics["haptic_device.x_true"][:, 2]) == 0.0
    for wrench in ("hand.F", "controller.F_drift", "controller.F_motor"):
        np.testing.assert_array_equal(found.haptics[wrench][:, 2], 0.0)
    text = "\n".join(_lines(found))
    assert "the device renders forces, no moments: its handle is a point" in text
    assert "turned from it" not in text
    assert "motors" not in text


def _lines(found):
    return [*numbers(found), *lines(found)]


def test_with_encoders_and_its_default_gains_it_stays_within_3_mm():
    """And within the energy that is tolerated."""
    found = run_once("closed-loop-2diy", ["sensing=encoders"])
    row = judged_numbers(found)
    assert found.record.end.reason == "duration"
    assert row[METRIC] <= 3.0
    assert energy_share(row) <= 1.0


def test_a_stage_holds_the_angle_and_needs_the_topology_controller():
    options = ["device.extends=stage", "hand.wrench=[-0.5, 0, 0]", "controller.bias=full"]
    found = run_once("closed-loop-ideal", options)
    row = judged_numbers(found)
    assert row[METRIC] <= 5.0
    assert row["theta_max_rad"] <= 0.05
    assert np.abs(found.haptics["controller.F_drift"][:, 2]).max() > 0.0
    assert "motors" not in "\n".join(_lines(found))
    off = ["device.extends=stage", "hand.wrench=[-0.5, 0, 0]", "controller.topology=false"]
    left = run_once("closed-loop-ideal", off)
    assert left.record.end.reason == "stop_when"


def test_a_device_from_elsewhere_tells_workspace_and_motors_by_its_ports(tmp_path):
    """One that stands still: .03 of .1 N.m in a motor, 4 mm inside of its workspace, and no arms of
    the twin in the drawing."""
    eye = {f"M[{i},{j}]": float(i == j) for i in (1, 2, 3) for j in (1, 2, 3)}
    poses = entries("x", 3) | entries("v", 3) | entries("x_true", 3) | entries("v_true", 3)
    own = entries("tau_applied", 2, 0.03) | entries("torque_limit", 2, 0.1)
    outputs = poses | eye | entries("c", 3) | own | {"workspace_margin": 0.004}
    inputs = entries("F_motor", 3) | entries("F_hand", 3)
    board = slave(tmp_path, "Desk", ("input", inputs), ("output", outputs))
    options = ["duration=0.1", f'fmu.+={{replaces="haptic_device", path="{board}"}}']
    found = hl.run("closed-loop-ideal", options, out=tmp_path / "run", figures=False)
    results = load(tmp_path / "run")
    assert Measures(results).motors == {"": pytest.approx(0.3)}
    assert found.run["end"]["reason"] == "duration"
    assert described_devices(results) == {}
    labels = run_figures.figures(results)["mechanism"].axes[0].get_legend_handles_labels()[1]
    assert "arms of the device" not in labels
