"""Bricard's mechanism in the hand: the whole loop of a device and a controller in space."""

import math
from functools import cache

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.visualization.figures import run_figures
from tests.spatial_linkages import BAR_IN_HAND

FAST = {"haptics__rate": 512, "graphics__rate": 64, "duration": 0.0625}
"""As the observer wants it."""


@cache
def ran(**options):
    named = {key.replace("__", "."): value for key, value in options.items()}
    return hl.run("closed-loop-bricard", {"haptics.rate": 64, "duration": 0.5, **named})


def test_the_whole_loop_keeps_the_handle_at_the_point():
    """What is measured, shaped and constrained is of three lengths: no entry is an angle."""
    found = ran(graphics__rate=16)
    assert found.run["end"]["reason"] == "duration"
    apart = found["virtual_mechanism.x"] - found["haptic_device.x_true"]
    assert found.tracking().distance_mm == pytest.approx(1e3 * np.linalg.norm(apart, axis=1))
    assert found.tracking().distance_mm.max() < 5.0
    assert not found.tracking().angle_rad.any()
    assert np.ptp(found["virtual_mechanism.x"], axis=0).min() > 1e-3
    assert (found["virtual_environment.n_constraints"] == 2).all()


def test_figures_of_a_point_have_no_moments():
    figures = run_figures.figures(ran(graphics__rate=16))
    labels = [axes.get_ylabel() for axes in figures["forces"].axes]
    assert labels == ["force (N)", "motor torque (N.m)"]
    (free,) = figures["constraints"].axes[0].child_axes
    assert free.get_ylabel() == "directions free to move, of x, y and z"


def test_projector_and_mobility_of_the_copy_are_those_of_its_pose():
    """Lambda^-1 of a point that moves along one curve has rank 1, and P_c is the rest."""
    found = ran(graphics__rate=16)
    for mobility, P in zip(
        found["virtual_environment.Lambda_inv"], found["virtual_environment.P_c"], strict=True
    ):
        along = np.linalg.eigh(mobility)[1][:, -1]
        assert pytest.approx(np.eye(3) - np.outer(along, along), abs=1e-9) == P


@pytest.mark.parametrize("sensing", ["ideal", "encoders"])
def test_the_device_pays_for_what_its_hand_and_motors_do(sensing):
    """The kinetic energy of the ideal device's point is the work of hand and motors on it."""
    found = ran(sensing=sensing, **FAST)
    x, v = found["haptic_device.x_true"], found["haptic_device.v_true"]
    pushed = found["hand.F"] + found["controller.F_motor"]
    work = np.cumsum((pushed[:-1] * np.diff(x, axis=0)).sum(axis=1))
    assert 0.05 * (v[1:] ** 2).sum(axis=1) == pytest.approx(work, abs=1e-9)


def test_an_observer_beside_the_device_is_the_one_in_it():
    options = {"sensing": "encoders", **FAST}
    inside, beside = ran(**options), ran(device__observer__beside=True, **options)
    for signal in ("virtual_mechanism.x", "haptic_device.x_true"):
        assert beside[signal] == pytest.approx(inside[signal], rel=0, abs=1e-12)
    assert math.isfinite(inside["haptic_device.F_hand_observed"].max())


@pytest.mark.parametrize("name", ["ideal-3", "falcon", "phantom-premium"])
def test_a_bar_is_felt_alike_through_every_device(name, tmp_path):
    """The handle follows the bar's end, whatever the device: within a hundredth of its way."""
    path = tmp_path / "bar.toml"
    path.write_text(BAR_IN_HAND % name)
    found = hl.run(path)
    way = np.linalg.norm(np.diff(found["virtual_mechanism.x"], axis=0), axis=1).sum()
    assert found.run["end"]["reason"] == "duration"
    assert way > 0.02
    assert found.tracking().distance_mm.max() < 10 * way
    assert np.linalg.norm(found["haptic_device.x_true"] - [0, 0, -0.1], axis=1) == pytest.approx(
        0.1, abs=0.01 * way
    )


def test_the_distance_grows_with_the_period_of_the_frames():
    """Without weight the hand's 0.2 N meet the mobility of the frame before alone: micrometres, in
    proportion to the period of the frames."""
    hand = {"type": "constant", "wrench": [-0.2, 0.0, 0.0]}
    options = {"linkage.gravity": [0.0, 0.0, 0.0], "hand": hand}
    runs = [hl.run("closed-loop-bricard", {**options, "graphics.rate": f}) for f in (10, 30, 60)]
    slow, usual, fast = (1e3 * run.tracking().distance_mm.max() for run in runs)
    assert slow < 10.0
    assert slow / usual == pytest.approx(3.0, rel=0.1)
    assert usual / fast == pytest.approx(2.0, rel=0.1)


def test_an_exported_loop_has_the_bits_and_the_lengths_of_its_scene(tmp_path):
    path = tmp_path / "bar.toml"
    path.write_text(BAR_IN_HAND % "ideal-3")
    ours, theirs = hl.run(path), hl.run(hl.export(path, out=tmp_path / "bar.ssp"))
    x = "haptic_device.x_true"
    np.testing.assert_array_equal(ours[x], theirs[x])
    np.testing.assert_array_equal(ours.tracking(), theirs.tracking())
    assert not theirs.tracking().angle_rad.any()
