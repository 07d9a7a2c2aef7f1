"""The workspace of the twin pantograph against closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest

from hapticlink.components.device.workspace import lines, margin, workspace
from tests.devices import device
from tests.reference.twin_pantograph import NUMBERS

DEVICE, TWIN = SimpleNamespace(**NUMBERS), device()
SPACE = workspace(TWIN)
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
    near, far = [[0.20, 0.0], [-0.25, 0.0]], [[0.20, 0.0], [0.25, 0.0]]
    keys = {
        "joint.a_crank.at_child": [-0.25, 0.0],
        "loop.0.at": near,
        "loop.1.at": far,
        "loop.2.at": far,
        "start": {"a_left": 1.9, "a_elbow_left": -0.7, "a_crank": 0.35, "a_right": 1.2,
                  "a_elbow_right": 0.7, "b_left": -1.9, "b_elbow_left": 0.7, "b_right": -1.2,
                  "b_elbow_right": -0.7},
    }  # fmt: skip
    space = workspace(device(keys=keys))
    assert space.extent(space.every) is None
    assert space.turns
    for low, high in space.turns:
        assert 0 < low < np.pi / 2 < high < np.pi


def test_a_device_that_cannot_be_assembled_is_refused() -> None:
    with pytest.raises(ValueError, match="its loops do not close near `start`"):
        workspace(device(keys={"joint.a_left.at_parent": [0.0, -1.0]}))


def test_the_margin_is_the_distance_to_the_stop() -> None:
    """On the line of symmetry, at theta = 0, the outer arms of both planes stretch alike."""
    pose = np.array([[DEVICE.base_x, 0.0, 0.0]])
    reach = np.hypot(DEVICE.base_half_width + HALF_CRANK, HEIGHT)
    assert margin(TWIN, pose) == pytest.approx([LONGEST - reach], abs=1e-12)


def test_lines_have_the_lengths_of_their_bodies_and_meet_at_pins() -> None:
    drawn = lines(TWIN, (0.03, -0.02, 0.7))
    lengths = sorted(float(np.linalg.norm(line[-1] - line[0])) for line in drawn)
    np.testing.assert_allclose(lengths, [0.08, *[0.16] * 4, *[0.20] * 4])
    crank = next(line for line in drawn if len(line) == 3)
    np.testing.assert_allclose(crank[1], (0.03, -0.02), atol=1e-15)
    ends = np.vstack([line[[0, -1]] for line in drawn])
    apart = np.linalg.norm(ends[:, None] - ends[None], axis=2)
    assert np.count_nonzero((apart < 1e-12).sum(axis=1) == 1) == 4  # the base joints alone
