"""A rod between two balls, which turns idly: where that hides the linkage's own motion, a run says
so."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.idle_spins import find_idle_spins, spinning
from hapticlink.analysis.findings.summary import describe_assembly
from hapticlink.components.dynamics.assembly import start_coordinates
from hapticlink.components.specs.linkage import Body, Directions, OperationalPoint
from tests.spatial_linkages import bennett, rssr, top

BESIDE, ON_THE_LINE = (0.1, 0.05, 0.1), (0.1, 0.05, 0.125)
"""Points of the rod, which goes from its ball to (.2, .1, .25)."""
SCENE = """
title = "A crank, a rod and a rocker"
packaging = "python"
haptics.rate = 64
duration = 0.05
mechanism.directions = true

[linkage]
operational_point = { body = "rod", at = [0.1, 0.05, 0.1] }
body = [
  { name = "crank", mass = 0.3, inertia = 0.001, center = [0.05, 0.0, 0.0] },
  { name = "rocker", mass = 0.3, inertia = 0.001, center = [0.0, 0.0, 0.1] },
  { name = "rod", mass = 0.3, inertia = 1e-5, center = [0.1, 0.05, 0.125] },
]
joint = [
  { name = "crank", child = "crank" },
  { name = "rocker", child = "rocker", at_parent = [0.3, 0.1, 0.0], axis = [1.0, 0.0, 0.0] },
  { name = "rod", type = "spherical", parent = "crank", child = "rod", at_parent = [0.1, 0.0] },
]
loop = [
  { type = "spherical", bodies = ["rod", "rocker"], at = [[0.2, 0.1, 0.25], [0.0, 0.0, 0.25]] },
]
"""


def holding(body: str, at: tuple[float, float, float], inertia: float | None = None):
    linkage = replace(rssr(), operational_point=OperationalPoint(body=body, at=at))
    if inertia is None:
        return linkage
    *others, rod = linkage.body
    wide = Body(name=rod.name, mass=rod.mass, inertia=inertia, center=rod.center)
    return replace(linkage, body=(*others, wide))


def test_what_turns_idly_hangs_on_two_balls() -> None:
    assert spinning(rssr()) == ["rod"]
    for linkage in (rssr("rod"), bennett(), top()):
        assert spinning(linkage) == []


@pytest.mark.parametrize(
    ("linkage", "tolerance", "said"),
    [
        (holding("rod", BESIDE), 0.1, True),
        (holding("rod", BESIDE), 1e-3, False),
        (holding("rod", BESIDE, inertia=0.1), 0.1, False),
        (holding("rod", ON_THE_LINE), 0.1, False),
        (holding("rocker", (0.0, 0.0, 0.25)), 0.1, False),
    ],
    ids=["beside", "tolerance", "thick", "on the line", "another body"],
)
def test_it_is_told_where_it_hides_a_motion(linkage, tolerance: float, said: bool) -> None:
    q = start_coordinates(linkage)
    lines = [*find_idle_spins(linkage, Directions(rank_tolerance=tolerance), q)]
    assert bool(lines) == said
    if said:
        assert lines[0].startswith("warning: rod turns idly about the line through its two balls")
        assert "takes 1 of the linkage's own motions for constrained" in lines[0]


@pytest.mark.parametrize("directions", [True, False])
def test_a_run_that_finds_constrained_directions_says_it(tmp_path: Path, directions: bool) -> None:
    """In its summary, and there with the two directions that are taken for constrained."""
    (tmp_path / "rssr.toml").write_text(SCENE)
    r = hl.run(tmp_path / "rssr.toml", {"mechanism.directions": directions})
    lines = [line for line in str(r).splitlines() if "turns idly" in line]
    assert len(lines) == directions
    if directions:
        mobility = r["virtual_mechanism.Lambda_inv"][0].reshape(3, 3)
        assert np.linalg.eigvalsh(mobility)[-1] > 10 * np.linalg.eigvalsh(mobility)[-2]
        assert r["virtual_mechanism.n_constraints"][0] == 2


def test_a_start_beyond_half_a_turn_is_not_moved_by_assembly():
    """A ball turned by 264 degrees has the shorter vector, -16 v / v'v, from the first row on."""
    joint = {"name": "ball", "type": "spherical"}
    linkage = {"joint": [joint], "start": {"ball": [0.1, 0.2, 9.0]}}
    shorter = -16.0 * np.array([0.1, 0.2, 9.0]) / 81.05
    assert not [*describe_assembly(linkage, shorter)]
    assert [*describe_assembly(linkage, shorter + 0.2)]
