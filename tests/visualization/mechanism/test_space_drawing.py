"""A linkage in space as it is drawn: where its lines are, in which order, and how they are seen."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from hapticlink.components.specs.linkage import (
    Body,
    Joint,
    Linkage,
    Loop,
    Mechanism,
    OperationalPoint,
)
from hapticlink.visualization.mechanism.drawing import draw
from hapticlink.visualization.mechanism.mark_places import in_order, world
from hapticlink.visualization.mechanism.picture import Part, Picture, directions_in_space
from hapticlink.visualization.mechanism.view import PLANE_VIEW, View, view_of
from tests.blocks import Running, virtual_mechanism
from tests.spatial_linkages import bricard, rssr
from tests.visualization.browser_code.javascript import javascript

STILL = np.zeros(5)
CORNERS = [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)]
"""Of the cube on whose edges Bricard's rods start."""


def lines(linkage, q):
    """The ends of the bodies' lines in the world, in the order of the marks."""
    picture = Picture(linkage, {}, None)
    frame = picture.at_rest(q)
    bodies = [mark for mark in picture.marks if mark.role == "body"]
    return [np.array([world(frame, end) for end in mark.at]) for mark in bodies]


def test_the_lines_of_bodies_go_from_joint_to_joint():
    for i, found in enumerate(lines(bricard(), STILL)):
        assert found == pytest.approx(np.array(CORNERS[i : i + 2], float), abs=1e-15)


def test_a_rod_is_drawn_between_its_points():
    first, second = lines(rssr("rod"), np.array([np.pi / 2, 0.0]))[-1]
    assert first == pytest.approx([0.0, 0.1, 0.0], abs=1e-15)
    assert second == pytest.approx([0.3, 0.1, 0.25])


def test_what_is_farther_from_the_eye_is_drawn_first():
    picture = Picture(bricard(), {}, None)
    frame = picture.at_rest(STILL)
    ordered = in_order(picture.marks, frame, picture.view)
    assert [m.role for m in ordered] == [m.role for m in picture.marks]
    middles = [np.mean([world(frame, end) for end in m.at], axis=0)
               for m in ordered if m.role == "body"]  # fmt: skip
    near = np.array(middles) @ picture.view.rows[2]
    assert (np.diff(near) >= 0).all()
    assert np.ptp(near) > 0.5


@pytest.mark.parametrize("gravity", [None, (0.0, -9.81, 0.0), (0.0, 0.0, -9.81), (1.0, 2.0, 3.0)])
def test_up_is_against_gravity_and_lengths_are_those_of_a_parallel_projection(gravity):
    rows = view_of(replace(bricard(), gravity=gravity)).rows
    assert rows @ rows.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rows) == pytest.approx(1.0)
    right, up, _ = rows @ -np.array(gravity or (0.0, 0.0, -1.0))
    assert right == pytest.approx(0.0, abs=1e-12)
    assert up > 0


def test_the_page_projects_as_the_figures_do():
    """The plane as it is; a view in space also when it is turned, and there and back."""
    assert (PLANE_VIEW.rows == np.eye(3)).all()
    given = view_of(replace(bricard(), gravity=(1.0, 2.0, 3.0)))
    answer = """const view = new View(given);
      view.turn(0.3, 0.2);
      const plane = new View(given.plane);
      answer = [view.rows, view.back(view.project([1, 2, 3])), plane.project([0.3, 0.1])];"""
    rows, there, flat = javascript("view.js", answer, asdict(given) | {"plane": asdict(PLANE_VIEW)})
    turned = View(given.aside, given.up, given.turned + 0.3, given.above + 0.2, 3)
    assert np.array(rows) == pytest.approx(turned.rows, abs=1e-15)
    assert there == pytest.approx([1, 2, 3])
    assert flat == [0.3, 0.1, 0]


def test_the_force_in_a_rod_holds_a_lever_up():
    """A lever of 0.4 m hangs level on a rod from above its end, and has 2 kg at a quarter of it."""
    lever = Linkage(
        body=(Body(name="lever", mass=2.0, inertia=(0.01, 0.01, 0.01), center=(0.1, 0.0, 0.0)),),
        joint=(Joint(name="hinge", child="lever", axis=(0.0, 1.0, 0.0)),),
        loop=(Loop(type="rod", bodies=("lever", "ground"), at=((0.4, 0.0), (0.4, 0.0, 0.3)),
                   length=0.3),),
        operational_point=OperationalPoint(body="lever"),
        gravity=(0.0, 0.0, -9.81),
    )  # fmt: skip
    multipliers = Running(virtual_mechanism(lever, Mechanism())).outputs("lambda")["lambda"]
    (force,) = Picture(lever, {}, None).drawn({"q": [0.0], "lambda": multipliers.tolist()})["cut"]
    assert force == pytest.approx([0.0, 0.0, 2.0 * 9.81 / 4], abs=1e-9)


@pytest.mark.parametrize("rank", range(4))
def test_constrained_directions_span_the_range_of_the_projector(rank):
    part = Part("", "directions", ("P_c",), (9,), directions_in_space(), sparse=True)
    basis = np.linalg.qr(np.random.default_rng(rank).normal(size=(3, 3)))[0][:, :rank]
    found = np.array(part.value({"P_c": (basis @ basis.T).ravel()})).reshape(-1, 3)
    assert len(found) == rank
    assert found.T @ found == pytest.approx(basis @ basis.T, abs=1e-12)


def test_what_is_drawn():
    axes = Figure().add_subplot()
    draw(axes, bricard(), STILL, STILL + 0.1)
    assert {text.get_text() for text in axes.texts} >= {*(f"rod{i}" for i in range(5)), *"xyz"}
    labels = axes.get_legend_handles_labels()[1]
    assert {"the linkage at the end", "axis of a joint", "operational point"} <= {*labels}
