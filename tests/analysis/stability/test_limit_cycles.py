"""Limit cycles of a wall by counts and friction, against runs of the FMUs."""

from __future__ import annotations

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability.limit_cycles import CountedWall
from hapticlink.analysis.stability.wall_limits import limit_with_quantum

QUANTUM = 1e-3
WALLS = {
    "counts alone": CountedWall(0.3, 5.0, 1 / 512, 1000.0, QUANTUM),
    "friction": CountedWall(0.3, 5.0, 1 / 512, 2000.0, QUANTUM, 0.4),
    "much friction": CountedWall(0.2, 2.0, 1 / 256, 300.0, QUANTUM, 0.12),
    "late": CountedWall(0.3, 5.0, 1 / 512, 700.0, QUANTUM, 0.1, 0.0, 1),
    "late by two": CountedWall(0.5, 4.0, 1 / 512, 300.0, QUANTUM, 0.03, 0.0, 2),
    "damper": CountedWall(0.3, 5.0, 1 / 512, 2000.0, QUANTUM, 0.2, 0.5),
}


def run(wall: CountedWall, off: float = 3e-4) -> np.ndarray:
    """The last 2 of 8 s of the handle about the edge between two counts (m), where the hand pushes
    with the mean force of both."""
    options = {
        "duration": 8.0,
        "haptics.rate": round(1 / wall.T),
        "mechanism.substeps": 8,
        "linkage.body.handle.mass": wall.m,
        "linkage.joint.rail.damping": wall.b,
        "linkage.start.rail": wall.quantum + off,
        "fmu.wall.settings.unilateral": False,
        "fmu.wall.settings.quantum": wall.quantum,
        "fmu.wall.start.stiffness": wall.K,
        "hand.wrench": [wall.K * wall.quantum / 2, 0.0, 0.0],
    }
    if wall.friction:
        options["linkage.joint.rail.friction"] = wall.friction
    if wall.B:
        options |= {"fmu.wall.settings.damping": 1.0, "fmu.wall.start.damping": wall.B}
    if wall.periods:
        options["delays.wall.F"] = wall.periods * wall.T
    table = hl.run("virtual-wall", options)["haptics"]
    x: np.ndarray = table["virtual_mechanism.x"][-round(2 / wall.T) :, 0] - wall.quantum
    return x


@pytest.mark.parametrize("wall", WALLS.values(), ids=WALLS)
def test_a_run_ends_in_one_of_the_cycles(wall: CountedWall) -> None:
    cycles = wall.cycles()
    amplitudes = [cycle.amplitude for cycle in cycles]
    assert amplitudes == sorted(amplitudes)
    x = run(wall)
    assert amplitudes[0] * 0.9 < np.ptp(x) / 2 < amplitudes[-1] * 1.05
    hertz = np.count_nonzero((x[1:] >= 0) != (x[:-1] >= 0)) / 2 / 2.0
    assert cycles[-1].frequency * 0.95 < hertz < cycles[0].frequency * 1.05


def test_below_the_published_limit_of_counts_a_run_rests() -> None:
    """And just above it does not: K = 2 f_c/quantum."""
    wall = WALLS["friction"]
    limit = limit_with_quantum(wall.b, wall.T, wall.friction, wall.quantum)
    assert wall.quiet == limit == pytest.approx(800.0)
    below, above = wall._replace(K=0.9 * limit), wall._replace(K=1.5 * limit)
    assert not below.cycles()
    assert np.ptp(run(below)) < 1e-6
    assert np.ptp(run(above)) > 1e-6 < above.cycles()[-1].amplitude


def test_without_friction_the_shortest_cycle_is_that_of_a_mass() -> None:
    """One period to and fro under u: v = u T/(2 m) at the samples, so the way is u T^2/(8 m)."""
    wall = CountedWall(0.3, 0.1, 1 / 512, 1000.0, QUANTUM)
    u = wall.K * QUANTUM / 2
    shortest = wall.cycles()[0]
    assert shortest.frequency == 256.0
    assert shortest.amplitude == pytest.approx(u * wall.T**2 / (8 * wall.m), rel=1e-3)


def test_damping_of_differences_needs_friction_of_its_own() -> None:
    """A count in one period is a velocity of quantum/T: B quantum/T beside K quantum/2."""
    wall = CountedWall(0.3, 5.0, 1 / 512, 400.0, QUANTUM, 0.4, 0.2)
    assert wall.quiet == pytest.approx(2 * (0.4 / QUANTUM - 0.2 * 512))
    assert not wall._replace(K=0.99 * wall.quiet).cycles()
    assert wall._replace(K=1.01 * wall.quiet).cycles()
