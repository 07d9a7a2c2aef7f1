"""Start rates: those of the scene are kept, the others follow from the geometry (by hand)."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hapticlink.components.dynamics.assembly import AssemblyError
from hapticlink.components.specs.linkage import (
    Body,
    GraphicsCopy,
    Joint,
    Linkage,
    Loop,
    OperationalPoint,
)
from hapticlink.orchestrator import open_scene
from tests.blocks import Running, advance, running, virtual_environment


def moving(name: str, **given: Any) -> tuple[Linkage, Running]:
    """A shipped linkage with rates of joints, or another start."""
    linkage = open_scene.load(name).linkage
    assert linkage
    start = given.pop("start", linkage.start)
    linkage = replace(linkage, start=start, start_velocity=given)
    return linkage, running(linkage)


def test_a_given_crank_moves_a_four_bar_as_its_velocity_loop_says() -> None:
    """w_a a + w_b b = w_c c with the links as complex numbers; joint rates are differences."""
    _, block = moving("four-bar", crank=2.0)
    crank, wrist, rocker = block.y["q"]
    a, b, c = (
        length * np.exp(1j * angle)
        for length, angle in ((0.04, crank), (0.12, crank + wrist), (0.09, rocker))
    )
    loop = np.array([[b.real, -c.real], [b.imag, -c.imag]])
    coupler, follower = np.linalg.solve(loop, [-2.0 * a.real, -2.0 * a.imag])
    np.testing.assert_allclose(block.y["qd"], [2.0, coupler - 2.0, follower], rtol=1e-12)


@pytest.mark.parametrize(("joint", "rate"), [("crank", 10.0), ("cylinder", -0.3)])
def test_a_slider_crank_takes_the_rate_of_either_end(joint: str, rate: float) -> None:
    """x = r cos a + sqrt(l^2 - r^2 sin^2 a), b = -a - asin(r/l sin a)."""
    _, block = moving("slider-crank", **{joint: rate})
    a, r, rod = block.y["q"][0], 0.05, 0.15
    height = math.sqrt(rod**2 - (r * math.sin(a)) ** 2)
    slope = -r * math.sin(a) * (1 + r * math.cos(a) / height)
    crank = rate if joint == "crank" else rate / slope
    expected = [crank, -crank * (1 + r * math.cos(a) / height), crank * slope]
    np.testing.assert_allclose(block.y["qd"], expected, rtol=1e-12)
    given = {"crank": 0, "cylinder": 2}[joint]
    assert block.y["qd"][given] == pytest.approx(rate, rel=1e-14)


def test_what_the_loops_leave_free_changes_least() -> None:
    """The five-bar has two: of all rates with the given one, the shortest."""
    linkage, block = moving("five-bar", shoulder1=1.5)
    along, other, base = (
        moving("five-bar", **rates)[1].y["qd"]
        for rates in (
            {"shoulder1": 0.0, "shoulder2": 1.0},
            {"shoulder1": 0.0, "elbow1": 1.0},
            {"shoulder1": 1.5, "shoulder2": 0.0},
        )
    )
    np.testing.assert_allclose(other / other[2], along, rtol=1e-10)  # one direction is left
    shortest = base - along * (along @ base) / (along @ along)
    np.testing.assert_allclose(block.y["qd"], shortest, rtol=1e-9)
    np.testing.assert_array_equal(Running(block.component).y["qd"], block.y["qd"])
    assert linkage.start_velocity == {"shoulder1": 1.5}


def test_too_many_rates_are_refused_with_the_nearest_that_fit() -> None:
    with pytest.raises(AssemblyError, match=r"gives crank = 2, rocker = 0, .* nearest, ") as error:
        moving("four-bar", crank=2.0, rocker=0.0)
    pairs = re.findall(r"(\w+) = ([^,]+)", str(error.value).split("nearest, ")[1])
    nearest = {name: float(value) for name, value in pairs}
    _, block = moving("four-bar", crank=nearest["crank"])
    assert block.y["qd"][2] == pytest.approx(nearest["rocker"], rel=1e-8)
    np.testing.assert_allclose(moving("four-bar", **nearest)[1].y["qd"], block.y["qd"], rtol=1e-8)


def test_a_copy_starts_with_the_same_rates() -> None:
    linkage, block = moving("slider-crank", crank=3.0)
    copy = Running(virtual_environment(linkage, GraphicsCopy(), None))
    np.testing.assert_allclose(copy.y["v"], block.y["v"], rtol=1e-13)


def test_a_piston_at_its_dead_centre_has_no_rate() -> None:
    dead = {"crank": 0.0, "big_end": 0.0, "cylinder": 0.2}
    with pytest.raises(AssemblyError, match=r"cylinder = 0\.1"):
        moving("slider-crank", start=dead, cylinder=0.1)
    _, block = moving("slider-crank", start=dead, crank=4.0)
    np.testing.assert_allclose(block.y["qd"], [4.0, -4.0 * (1 + 0.05 / 0.15), 0.0], atol=1e-12)


def in_line(**given: float) -> Linkage:
    """A parallelogram of cranks of 1 m and a coupler of 2 m with all links in line: there it may
    go on as a parallelogram or as its crossed form."""
    crank = {"mass": 1.0, "inertia": 1 / 12, "center": (0.5, 0.0)}
    body = (
        Body(name="crank", **crank),
        Body(name="coupler", mass=1.0, inertia=1 / 3, center=(1.0, 0.0)),
        Body(name="rocker", **crank),
    )
    joint = (
        Joint(name="A", child="crank"),
        Joint(name="B", parent="crank", child="coupler", at_parent=(1.0, 0.0)),
        Joint(name="D", child="rocker", at_parent=(2.0, 0.0)),
    )
    loop = (Loop(bodies=("coupler", "rocker"), at=((2.0, 0.0), (1.0, 0.0))),)
    point = OperationalPoint(body="coupler")
    return Linkage(body=body, joint=joint, loop=loop, operational_point=point, start_velocity=given)


@pytest.mark.parametrize("given", [{"A": 1.0}, {"A": 1.0, "B": 0.0}, {"A": 1.0, "D": -1.0}])
def test_rates_along_no_branch_are_refused_where_branches_meet(given: dict[str, float]) -> None:
    """To second order, with rates a, b, d and c = a + b: a + 2 c = d and a^2 + 2 c^2 = d^2, so that
    c = 0 (parallel) or c = -2 a (crossed)."""
    with pytest.raises(AssemblyError, match="branches of the motion meet") as refused:
        running(in_line(**given))
    if given == {"A": 1.0}:
        assert "{ A = 1, B = -1, D = 1 } or { A = 1, B = -3, D = -3 }" in str(refused.value)


@pytest.mark.parametrize("given", [{"A": 1.0, "D": 1.0}, {"A": 1.0, "B": -3.0, "D": -3.0}])
def test_rates_along_a_branch_are_kept_with_their_energy_at_any_rate(
    given: dict[str, float],
) -> None:
    ends = []
    for rate in (200, 1000):
        block = running(in_line(**given))
        assert [block.y["qd"][i] for i in (0, 2)] == pytest.approx([given["A"], given["D"]])
        energy = block.y["energy"]
        advance(block, 0.5, rate)
        assert block.y["energy"] == pytest.approx(energy, rel=1e-4)
        ends.append(block.y["q"])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-4)


def test_a_redundant_loop_is_no_place_where_branches_meet() -> None:
    """W has lost rank at every pose of a parallelogram with a second, parallel coupler."""
    linkage = in_line(A=1.0)
    also = Body(name="second", mass=1.0, inertia=1 / 3, center=(1.0, 0.0))
    joint = Joint(name="E", parent="crank", child="second", at_parent=(0.5, 0.0))
    loop = Loop(bodies=("second", "rocker"), at=((2.0, 0.0), (0.5, 0.0)))
    doubled = replace(
        linkage,
        body=(*linkage.body, also),
        joint=(*linkage.joint, joint),
        loop=(*linkage.loop, loop),
        start={"A": 1.0, "B": -1.0, "D": 1.0, "E": -1.0},
    )
    block = running(doubled)
    np.testing.assert_allclose(block.y["qd"], [1.0, -1.0, 1.0, -1.0], atol=1e-9)
