"""The report's experiment through FMUs: distances, and the mistakes that distances hide."""

import numpy as np
import pytest

from hapticlink.analysis.findings.tracking import tracking
from hapticlink.orchestrator.experiment import simulate
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
    """M_d^-1 (F_motor + F_hand - c) = Lambda^-1 F_h at t = 0, to rounding."""
    haptics, graphics = runs["true", "none"].haptics, runs["true", "none"].graphics
    wrench = haptics["hand.F"][0]
    force = haptics["controller.F_motor"][0] + wrench - haptics["haptic_device.c"][0]
    a = np.linalg.solve(haptics["haptic_device.M"][0], force)
    expected = graphics["virtual_environment.Lambda_inv"][0] @ wrench
    np.testing.assert_allclose(a, expected, rtol=1e-12)


@pytest.mark.parametrize("bias", ["none", "full"])
def test_topology_wrench_does_no_work_on_free_motion(runs, bias):
    """(1 - P_c) S^-1 F_T = 0 with the projector that is held, to rounding."""
    haptics, graphics = runs["true", bias].haptics, runs["true", bias].graphics
    frame = np.searchsorted(graphics["time"], haptics["time"], side="right") - 1
    P = graphics["virtual_environment.P_c"][frame]
    scaled = haptics["controller.F_constraint"] / (1, 1, np.mean((0.042, 0.042, 0.0184, 0.0564)))
    free = scaled - np.einsum("kij,kj->ki", P, scaled)
    assert np.abs(free).max() < 1e-13 * np.abs(scaled).max()


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
