"""Scenes with contacts, further hands or a local model."""

import numpy as np
import pytest

from hapticlink.analysis.findings import summary
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.experiment import simulate

TOUCHED = "duration=0.6"
"""By then the hand has moved a link to the wall."""


@pytest.fixture(scope="module")
def walls(tmp_path_factory):
    """The haptic rows of `enclosure`, whose contacts are detected at the graphics rate."""
    return simulate("enclosure", tmp_path_factory.mktemp("walls"), [TOUCHED]).results.haptics


def test_the_hand_feels_the_wall_and_the_link_stays_out_of_it(tmp_path, walls):
    """Against a run without walls: the force of the walls turns the motion around."""
    alone = ["controller.contact=false", "contacts.enclosure=[[-1,-1],[1,-1],[1,1],[-1,1]]"]
    free = simulate("enclosure", tmp_path, [TOUCHED, *alone]).results.haptics
    gap, F = walls["virtual_mechanism.contact_gap"], walls["virtual_mechanism.F_env[1]"]
    assert gap.min() < 0
    assert gap.min() > -0.5e-3  # less than 15000 N/m x 0.5 mm
    assert np.abs(F).max() > 0.3
    assert F[gap >= 0].tolist() == [0.0] * int(np.sum(gap >= 0))
    assert free["virtual_mechanism.x[1]"].max() > walls["virtual_mechanism.x[1]"].max() + 2e-3


def test_detection_at_the_graphics_rate_is_near_that_at_the_haptic_rate(tmp_path, walls):
    assert open_scene.load("enclosure").contacts.detection == "graphics"
    options = [TOUCHED, "contacts.detection=haptics"]
    near = simulate("enclosure", tmp_path, options).results.haptics
    x, there = (run["virtual_mechanism.x"][:, :2] for run in (walls, near))
    assert np.abs(x - there).max() < 1e-4


def test_a_pendulum_keeps_e_squared_of_its_energy_at_each_limit(tmp_path):
    """Released at 1 rad from the vertical, at which it is stopped: V = m g l (1 - cos 1)."""
    limits = "{upper=-1.5707963267948966, stiffness=2000.0, restitution=0.7}"
    options = ["duration=2.0", "linkage.start={pivot=-2.5707963267948966}"]
    options.append(f"linkage.joint=[{{name='pivot', child='rod', limits={limits}}}]")
    rows = simulate("pendulum", tmp_path, options).results.haptics
    bottom = -9.81 * 0.5
    energy = rows["virtual_mechanism.energy"] - bottom
    kept = 9.81 * 0.5 * (1 - np.cos(1.0)) * 0.7 ** np.array([0, 2, 4])
    np.testing.assert_allclose(energy[[0, 512, 1020]], kept, rtol=3e-3)
    assert rows["virtual_mechanism.F_env"][:, 0].min() < -10  # the hand is pushed back


def test_a_second_hand_holds_its_point(tmp_path):
    two = simulate("two-hands", tmp_path, ["duration=0.5"]).results.haptics
    for i in (1, 2, 3):
        grip = two[f"hand_left.F[{i}]"]
        assert np.isfinite(grip).all()
    assert np.abs(two["hand_left.F[1]"]).max() > 0.01
    step = np.diff(two["virtual_mechanism.left.x[1]"]) * 512
    speed = two["virtual_mechanism.left.v[1]"]
    np.testing.assert_allclose(step, (speed[1:] + speed[:-1]) / 2, atol=1e-4)


def test_the_first_hand_feels_the_second(tmp_path):
    """The handle accelerates as the operational point does under the other hand's force alone, from
    the first tick on."""
    point = "linkage.point=[{name='left', body='link4', at=[0.02, 0.0]}]"
    options = ["duration=0.05", point, "hands.left={wrench=[0.5, 0.0, 0.0]}"]
    rows = simulate("closed-loop-ideal", tmp_path, [*options, "hand.wrench=[0.0, 0.0, 0.0]"])
    mechanism, handle = (
        rows.results.haptics[name] for name in ("virtual_mechanism.v", "haptic_device.v_true")
    )
    assert mechanism[1, 0] * 512.0 > 0.1
    np.testing.assert_allclose(handle[1], mechanism[1], rtol=1e-4)


def test_contact_rows_are_never_mixed(tmp_path):
    """A default hold that extrapolates leaves them as sampled, and run.json says so."""
    experiment = simulate("enclosure", tmp_path / "run", ["hold=foh", "duration=0.2"])
    holds = experiment.results.run["holds"]
    name = next(name for name in holds if ".contacts ->" in name)
    assert "zoh" in str(holds[name])
    assert "foh" in str(holds.values())


def test_the_copy_follows_free_objects(tmp_path):
    """push-disc until the disc has been hit: geometry that the graphics block finds gives nearly
    the motion of geometry that the mechanism finds."""
    q = []
    for detection in ("haptics", "graphics"):
        options = ["duration=1.2", "mechanism.events=0", f"contacts.detection={detection}"]
        rows = simulate("push-disc", tmp_path / detection, options).results.haptics
        assert rows["virtual_mechanism.F_env"].any()
        q.append(rows["virtual_mechanism.q"][:, 2:4])
    moved = np.abs(q[0][-1] - q[0][0]).max()
    assert moved > 1e-3  # of the disc
    assert np.abs(q[0] - q[1]).max() < 0.2 * moved


def test_contacts_that_are_too_deep_or_too_stiff_are_warned_of(tmp_path):
    """The disc starts on the axis of link 2, whose radius is 3 mm; b/m of the discs is 1/0.2 ms."""
    options = ["duration=0.02", "mechanism.events=0", "contacts.damping=300"]
    options.append("linkage.start.disc=[0.0445, 0.0148, 0.0]")
    results = simulate("push-disc", tmp_path, options).results
    told = "\n".join(line for line in summary.lines(results) if line.startswith("warning"))
    assert "link2 is 11.9 mm deep in disc, past the middle of the thinner one (3 mm)" in told
    assert "contacts of disc with block have a pole" in told


@pytest.mark.parametrize(
    ("detection", "integrator", "told"),
    [
        ("graphics", "passive-midpoint", True),
        ("haptics", "passive-midpoint", False),
        ("graphics", "rk4", False),
    ],
)
def test_that_a_frame_of_contacts_changes_the_energy_is_told(tmp_path, detection, integrator, told):
    """Of the method that makes none, which only holds between two frames: the energy rises there by
    more than the wrenches on the arm do in work."""
    options = ["duration=1.0", "graphics.rate=10", f"contacts.detection={detection}"]
    results = simulate(
        "push-disc", tmp_path, [*options, f"mechanism.integrator={integrator}"]
    ).results
    assert any("each new frame of contacts" in line for line in summary.lines(results)) == told
    table = results.haptics
    wrench = table["hand.F"] - table["controller.F_drift"]
    work = (wrench[:-1] * np.diff(table["virtual_mechanism.x"], axis=0)).sum(axis=1)
    gained = np.diff(table["virtual_mechanism.energy"]) - work
    if integrator == "passive-midpoint":
        assert (gained.max() > 1e-6) == told
