"""The continuous references of `hapticlink bench cosimulation`, and the short form of the bench."""

from functools import cache

import numpy as np
import pytest

from benchmarks import continuous
from benchmarks.continuous.absolute import Absolute
from benchmarks.continuous.march import march
from benchmarks.continuous.relative import Relative
from benchmarks.cosimulation.measure import (
    COLUMNS,
    SETTINGS,
    errors,
    front,
    measure,
    measured,
    run,
)
from benchmarks.cosimulation.points import CONTACT, LOOP, Point, points
from benchmarks.rows import Rows
from hapticlink.orchestrator import open_scene

ENDS = {LOOP: 0.5, CONTACT: 0.625}
"""After a change of the number of constrained directions, and after a contact has begun (s)."""
TOLERANCE = {"rtol": 1e-9, "atol": 1e-11}


@cache
def relative(name):
    """Grid, the loop in joint coordinates, and its handle with the changes of its mode."""
    grid = np.arange(round(ENDS[name] * continuous.GRID) + 1) / continuous.GRID
    loop = Relative(continuous.scene(name))
    return grid, loop, *march(loop, grid, method="DOP853", **TOLERANCE)


def absolute(scene, loop, grid):
    n = len(scene.linkage.joint)
    other = Absolute(scene, loop.start[:n], loop.start[n : 2 * n], loop.first_mode)
    return march(other, grid, method="LSODA", **TOLERANCE)


def apart(a, b):
    return float(np.linalg.norm(a - b, axis=1).max())


@pytest.mark.parametrize("name", ENDS)
def test_two_formulations_and_integrators_agree(name):
    grid, loop, handle, changes = relative(name)
    other, others = absolute(continuous.scene(name), loop, grid)
    assert apart(handle, handle[:1]) > 1e-3
    assert apart(handle, other) < 1e-8
    assert len(changes) == len(others) == (1 if name == LOOP else 0)
    np.testing.assert_allclose(changes, others, atol=1e-7)


@pytest.mark.parametrize(
    ("name", "changed", "share"),
    [
        (LOOP, "controller.topology=false", 0.25),
        (LOOP, "controller.bias=full", 0.25),
        (LOOP, "device.body.crank.mass=0.121", 1.0),  # felt from the change of mode on
        (CONTACT, "controller.bias=none", 0.25),
        (CONTACT, "controller.contact=false", 1.0),
        (CONTACT, "contacts.damping=250.0", 1.0),
    ],
)
def test_a_term_that_only_one_of_them_has_shows(name, changed, share):
    grid, loop, handle, _ = relative(name)
    options = [continuous.CONTINUOUS] + [continuous.DETECTED] * (name == CONTACT)
    scene, n = open_scene.load(name, [*options, changed]), round(share * len(grid))
    other, _ = absolute(scene, loop, grid[:n])
    assert apart(handle[:n], other) > 1e-7


def test_the_error_of_a_sampled_loop_falls_at_order_one(tmp_path):
    """Before the first change of mode, with nothing held between rates: zero-order holds of the
    haptic period alone are left."""
    grid, _, handle, _ = relative(LOOP)
    end, rates = 0.375, (512, 1024, 2048, 4096)
    found = [run(Point(rate=r), handle, tmp_path, end)[2] for r in rates]
    assert grid[-1] >= end
    slope = np.polyfit(np.log(rates), np.log(found), 1)[0]
    assert -1.15 < slope < -0.85


def test_errors_are_distances_in_mm():
    reference = np.zeros((3 * continuous.GRID + 1, 2))
    handle = reference.copy()
    handle[10] = 0.003, 0.004
    handle[2 * continuous.GRID] = 0.0, 0.01
    first, most, rms = errors(handle, reference)
    assert (first, most) == pytest.approx((5.0, 10.0))
    assert rms == pytest.approx(np.sqrt(125 / len(handle)))


def test_finished_rows_are_not_run_again(tmp_path):
    reference = continuous.Reference(*[np.zeros((3 * continuous.GRID + 1, 2))] * 2)
    path, chosen = tmp_path / "runs.csv", [Point(), Point(rate=1024)]
    measure(path, chosen[:1], {LOOP: reference}, 1, lambda *_: None)
    first = path.read_text()
    measure(path, chosen, {LOOP: reference}, 2, lambda *_: None)
    assert path.read_text().startswith(first)
    assert len(path.read_text().splitlines()) == 1 + 4


def test_the_front_has_no_beaten_and_no_unstable_point(tmp_path):
    rows = Rows(tmp_path / "rows.csv", COLUMNS, keys=len(SETTINGS) + 1)
    made = {
        "fast": (256, 1.0, 5.0, "duration"),
        "beaten": (512, 2.0, 6.0, "duration"),
        "exact": (1024, 3.0, 1.0, "duration"),
        "lost": (2048, 0.5, 0.1, "diverged"),
        "away": (4096, 0.4, 50.0, "duration"),
    }
    for rate, seconds, most, end in made.values():
        for number in range(3):
            times = seconds * (1 + 0.1 * number)
            rows.add(*Point(rate=rate).key, number, times, most, most, most, end, 3.0)
    found = measured(rows, LOOP)
    assert len(found) == len(made)
    assert [m.point.rate for m in front(found)] == [256, 1024]
    assert sum(m.unstable for m in found) == 2
    assert found[0].time == pytest.approx((1.05, 1.1, 1.15))


def test_points_are_scenes():
    """Every point is valid and known once; the quick form has both scenes."""
    every = points()
    assert len({p.key for p in every}) == len(every)
    for point in points(quick=True):
        open_scene.load(point.scene, point.options)
    assert {p.scene for p in points(quick=True)} == {LOOP, CONTACT}
