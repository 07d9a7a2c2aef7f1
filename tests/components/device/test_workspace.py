"""The workspace of the twin pantograph against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from hapticlink.components.device.workspace import links, margin, workspace
from hapticlink.components.specs.device import Device

DEVICE = Device()
SPACE = workspace(DEVICE)
FULL = DEVICE.proximal_length + DEVICE.distal_length
LONGEST = DEVICE.reach_limit * FULL
HALF_CRANK = DEVICE.crank / 2
HEIGHT = DEVICE.base_y_b


def test_extent_at_every_theta() -> None:
    """The crank's ends go all around the handle: it is half a crank nearer to each base joint."""
    reach = LONGEST - HALF_CRANK
    x = np.sqrt(reach**2 - HEIGHT**2) - DEVICE.base_half_width
    y = np.sqrt(reach**2 - DEVICE.base_half_width**2) - HEIGHT
    found = SPACE.extent(SPACE.every)
    assert found is not None
    np.testing.assert_allclose(found[0], [DEVICE.base_x - x, DEVICE.base_x + x], atol=1e-3)
    np.testing.assert_allclose(found[1], [-y, y], atol=1e-3)


def test_extent_at_some_theta() -> None:
    """Farthest in x with the crank along y, each end half a crank nearer to its base joints."""
    x = np.sqrt(LONGEST**2 - (HEIGHT - HALF_CRANK) ** 2) - DEVICE.base_half_width
    found = SPACE.extent(SPACE.some)
    assert found is not None
    np.testing.assert_allclose(found[0], [DEVICE.base_x - x, DEVICE.base_x + x], atol=1e-3)
    assert SPACE.turns == [(-np.pi, np.pi)]


def test_a_crank_that_is_too_long_turns_within_limits_only() -> None:
    """Upright on the base line's side an end may be half a crank too far from its base joints."""
    space = workspace(replace(DEVICE, crank=0.5))
    assert space.extent(space.every) is None
    assert space.turns
    for low, high in space.turns:
        assert 0 < low < np.pi / 2 < high < np.pi


def test_a_device_that_cannot_be_assembled_has_none() -> None:
    space = workspace(replace(DEVICE, base_y_a=-1.0))
    assert space.extent(space.some) is None
    assert space.turns == []


def test_the_margin_is_the_distance_to_the_stop() -> None:
    """On the line of symmetry, at theta = 0, the outer arms of both planes stretch alike."""
    pose = np.array([[DEVICE.base_x, 0.0, 0.0]])
    reach = np.hypot(DEVICE.base_half_width + HALF_CRANK, HEIGHT)
    assert margin(DEVICE, pose) == pytest.approx([LONGEST - reach], abs=1e-12)


def test_links_have_their_lengths_at_any_pose() -> None:
    base, elbow, end = np.moveaxis(links(DEVICE, (0.03, -0.02, 0.7)), 1, 0)
    np.testing.assert_allclose(np.linalg.norm(elbow - base, axis=1), DEVICE.proximal_length)
    np.testing.assert_allclose(np.linalg.norm(end - elbow, axis=1), DEVICE.distal_length)
    np.testing.assert_allclose((end[0] + end[2]) / 2, (0.03, -0.02))
