"""A linkage in space as it is drawn: where its lines are, and how they are projected."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from hapticlink.visualization.mechanism.space_drawing import draw, projection, rods, strokes
from tests.spatial_linkages import Z, bricard, rssr

STILL = np.zeros(5)
CORNERS = [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)]
"""Of the cube on whose edges Bricard's rods start."""


def test_the_lines_of_bodies_go_from_joint_to_joint():
    found = strokes(bricard(), STILL)
    for i, points in enumerate(found.values()):
        assert points[:2] == pytest.approx(np.array(CORNERS[i : i + 2], float), abs=1e-15)


def test_a_rod_is_drawn_between_its_points():
    ((first, second),) = rods(rssr("rod"), np.array([np.pi / 2, 0.0]))
    assert first == pytest.approx([0.0, 0.1, 0.0], abs=1e-15)
    assert second == pytest.approx([0.3, 0.1, 0.25])


@pytest.mark.parametrize("gravity", [None, (0.0, -9.81, 0.0), (0.0, 0.0, -9.81), (1.0, 2.0, 3.0)])
def test_up_is_against_gravity_and_lengths_are_those_of_a_parallel_projection(gravity):
    view = projection(replace(bricard(), gravity=gravity))
    onto = view(np.eye(3)) / 1e3
    assert onto @ onto.T == pytest.approx(np.eye(2), abs=1e-12)
    right, up = onto @ -np.array(gravity or (0.0, 0.0, -1.0))
    assert right == pytest.approx(0.0, abs=1e-12)
    assert up > 0


def test_what_is_drawn():
    axes = Figure().add_subplot()
    path = np.array([CORNERS[2], Z])
    draw(axes, bricard(), STILL, STILL + 0.1, path)
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == [*(f"rod{i}" for i in range(5)), "path of the point"]
    assert len(axes.lines) == 2 * 5 + 2
