"""The report's experiment through FMUs: distances, and the mistakes that distances hide."""

import numpy as np
import pytest

from hapticlink.analysis.findings.tracking import tracking
from hapticlink.orchestrator.experiment import simulate
from studies.report import measures
from studies.report.chapter6 import LENGTH_SCALE
from tests.shared_fixtures import run_once


@pytest.fixture(scope="module")
def runs():
    """(topology, bias) -> results of `closed-loop-ideal` at 30 Hz."""
    options = {
        ("true", "none"): (),
        ("false", "none"): ("controller.topology=false",),
        ("true", "full"): ("controller.bias=full",),
    }
    found = {of: run_once("closed-loop-ideal", given) for of, given in options.items()}
    assert all(run.fault is None for run in found.values())
    return found


def test_distance_with_and_without_the_topology_controller(runs):
    time, on = tracking(runs["true", "none"])
    assert time[-1] == 3.0
    assert on.max() < 8
    ended, off = tracking(runs["false", "none"])
    assert np.interp(2.0, ended, off) > 60
    common = time <= min(time[-1], ended[-1])
    assert off.max() > 10 * on[common].max()


def test_distance_with_velocity_terms_sent(runs):
    assert tracking(runs["true", "full"])[1].max() < 1


def test_device_accelerates_as_the_mechanism_at_the_start(runs):
    """Two plants, whose velocities after the first period are compared, not the law that has made
    the wrench of one of them."""
    assert measures.acceleration_error(runs["true", "none"]) < 1e-4


def test_topology_wrench_acts_on_free_motion_as_far_as_frames_are_old():
    """Against the mechanism's own P_c of the instant: with the held one, which has made F_T, there
    would be nothing at any rate. components/blocks/test_controller.py has the law itself."""
    shares = {
        rate: measures.free_work(
            run_once("closed-loop-ideal", ("mechanism.directions=true", f"graphics.rate={rate}")),
            LENGTH_SCALE,
        )
        for rate in (10, 30, 512)
    }
    medians = [median for median, _ in shares.values()]
    assert medians == pytest.approx([0.204, 0.0877, 0.0031], rel=0.05)
    assert shares[30][1] == pytest.approx(0.216, rel=0.05)


def test_one_or_two_directions_are_resisted(runs):
    count = runs["true", "none"].graphics["virtual_environment.n_constraints"]
    assert set(count) == {1.0, 2.0}


def test_jacobi_delay_makes_the_printed_gains_unstable(tmp_path):
    """One sample late, B_pc,theta = 0.375 exceeds its limit; 0.2 does not."""
    worst = {}
    for damping in (0.375, 0.2):
        options = ["coupling=jacobi", f"controller.teleoperation.damping=[70.0, 70.0, {damping}]"]
        experiment = simulate("closed-loop-ideal", tmp_path / str(damping), options)
        rate = experiment.results.haptics["controller.F_drift"][:, 2]
        worst[damping] = np.abs(np.diff(rate)).max()
    assert worst[0.375] > 30 * worst[0.2]
