"""Limits of stability of a virtual wall: closed forms, the lifted map within 0.5 %, and runs of the
FMUs within 2 %."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import hapticlink as hl
from hapticlink.analysis.stability import wall_limits
from hapticlink.analysis.stability.scene_variants import SceneVariants
from hapticlink.orchestrator import open_scene
from tests.analysis.stability.own_hand import BILATERAL, own_hand

M, D, T = 0.3, 5.0, 1 / 512
"""Mass (kg), damping (N.s/m) and period (s) of the scene."""
STIFFNESS, DAMPING = "fmu.wall.start.stiffness", "fmu.wall.start.damping"
UNDAMPED = BILATERAL | {"linkage.joint.rail.damping": 0.0, "fmu.wall.settings.damping": 5.0}
MEASURED = UNDAMPED | {
    "fmu.wall.settings.velocity": "measured",
    "connection.+": {"from": "virtual_mechanism.rail.velocity", "to": "wall.v"},
}
LATE = BILATERAL | {"delays": {"wall.F": T}}
LATER = BILATERAL | {"delays": {"wall.F": 2 * T}}
Options = dict[str, Any]


def test_closed_forms_give_the_reference_numbers() -> None:
    stable = [wall_limits.stable(M, D, T, periods) for periods in (0, 1, 2)]
    assert stable == pytest.approx([5147.9288, 1721.95, 1038.20], rel=1e-5)
    largest = [wall_limits.limit_without_damping(1.0, 1.0, n / 10) for n in range(1, 10)]
    assert largest == pytest.approx(TABLE, abs=5e-5)
    scaled = wall_limits.limit_without_damping(M, T, 0.8 * M / T) * T**2 / M
    assert scaled == pytest.approx(largest[7])
    assert wall_limits.passive(D, T) == pytest.approx(5120)
    assert wall_limits.passive(D, T, B=-1.0) == pytest.approx(4096)
    assert wall_limits.limit_with_measured_velocity(T, 5.0) == pytest.approx(5120)
    assert wall_limits.damper(M, T) == pytest.approx(307.2)
    assert wall_limits.limit_with_quantum(D, T, 0.1, 0.18e-3) == pytest.approx(1111, abs=0.2)


def looped(m: float, b: float, T: float, periods: int, K: float, B: float) -> float:
    """The spectral radius of x, v, the last x and the forces on their way, sampled and held."""
    n = 3 + periods
    E = expm(np.array([[0.0, 1.0, 0.0], [0.0, -b / m, 1.0 / m], [0.0, 0.0, 0.0]]) * T)
    wall = np.zeros(n)
    wall[[0, 2]] = -K - B / T, B / T
    A = np.zeros((n, n))
    A[:2, :2], A[2, 0] = E[:2, :2], 1.0
    A[:2] += np.outer(E[:2, 2], np.eye(n)[-1] if periods else wall)
    if periods:
        A[3] = wall
        A[range(4, n), range(3, n - 1)] = 1.0
    return float(np.abs(np.linalg.eigvals(A)).max())


@pytest.mark.parametrize(
    ("m", "b", "T", "periods", "B", "off"),
    [
        *((M, D, T, periods, B, 1e-6) for periods in (0, 1, 2, 5) for B in (0.0, 2.0)),
        *((1.0, b, 1.0, 0, 0.0, 5e-3) for b in (6.0, 3.7)),  # much damping
        *((1.0, b, 1.0, periods, 0.0, 5e-3) for b, periods in ((1e-6, 1), (1e-7, 3))),  # little
        *((1.0, 1e-2, 1.0, 2, 0.3, 5e-3), (1.0, 0.3, 1.0, 3, -0.1, 5e-3)),
    ],
)
def test_the_limit_is_where_the_loop_leaves_the_unit_circle(
    m: float, b: float, T: float, periods: int, B: float, off: float
) -> None:
    """By `off` of its K on either side."""
    K = wall_limits.stable(m, b, T, periods, B)
    around = K * np.array([1 - off, 1 + off, 2.0])
    expected = [looped(m, b, T, periods, k, B) for k in around]
    assert expected[0] < 1.0 < expected[1]
    radii = wall_limits.radius(m, b, T, periods, around, np.full(3, B))
    assert radii == pytest.approx(expected, rel=1e-6)


def test_a_damper_that_is_unstable_alone_has_no_limit() -> None:
    """3 samples late, beta = 0.5: a root crosses the unit circle at alpha = 3.46, behind others."""
    assert min(looped(1.0, 0.01, 1.0, 3, K, 0.5) for K in np.geomspace(1e-4, 10.0, 40)) > 1.0
    with pytest.raises(ValueError, match="stable for no K"):
        wall_limits.stable(1.0, 0.01, 1.0, 3, 0.5)


@pytest.mark.parametrize(
    ("delay", "K", "B"),
    [(0, 3000.0, 2.0), (0, 0.0, -7.0), (0, 1000.0, 0.0), (2, 1000.0, 0.0), (4, 1000.0, 0.0),
     (20, 1000.0, 0.0)],
)  # fmt: skip
def test_the_damping_of_a_passive_wall_is_that_of_colgate_and_schenkel(
    delay: int, K: float, B: float
) -> None:
    """b = K T/2 + |B|; with a delay and no damper K (T/2 + t_d), at the frequency 0."""
    found = wall_limits.passive_damping(T, delay, np.array([K]), np.array([B]))
    assert found[0] == pytest.approx(K * T * (0.5 + delay) + abs(B), rel=1e-4)


def test_quantities_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match=r"T = 0\.0: must be positive"):
        wall_limits.passive(5.0, 0.0)
    with pytest.raises(ValueError, match=r"delay = -1\.0: must not be negative"):
        wall_limits.limit_with_delay(5.0, T, -1.0)
    with pytest.raises(ValueError, match="m = nan: must be positive"):
        wall_limits.stable(np.nan, 5.0, T)
    with pytest.raises(ValueError, match="b = 0"):
        wall_limits.stable(M, 0.0, T)


def test_small_gains_with_a_delay_come_to_the_rule_of_gil() -> None:
    """Where b T/m is small the exact limit and the rule agree."""
    exact = wall_limits.stable(M, 0.05, T, 2)
    assert wall_limits.limit_with_delay(0.05, T, 2 * T) == pytest.approx(exact, rel=1e-3)


CASES = [
    pytest.param(BILATERAL, STIFFNESS, wall_limits.stable(M, D, T), id="spring"),
    pytest.param(LATE, STIFFNESS, wall_limits.stable(M, D, T, 1), id="a sample late"),
    pytest.param(LATER, STIFFNESS, wall_limits.stable(M, D, T, 2), id="two samples late"),
    pytest.param(
        MEASURED, STIFFNESS, wall_limits.limit_with_measured_velocity(T, 5.0), id="velocity read"
    ),
    pytest.param(MEASURED | {STIFFNESS: 0.0}, DAMPING, wall_limits.damper(M, T), id="damper alone"),
]


@pytest.mark.parametrize(("options", "key", "limit"), CASES)
def test_the_lifted_map_has_the_limit(options: Options, key: str, limit: float) -> None:
    found = [own_hand("virtual-wall", options | {key: k * limit}) for k in (0.995, 1.005)]
    assert [f.verdict for f in found] == ["stable", "unstable"]


@pytest.mark.parametrize(("options", "key", "limit"), CASES)
def test_runs_grow_beyond_the_limit(options: Options, key: str, limit: float) -> None:
    assert growth(options, key, 0.98 * limit) < 1 < growth(options, key, 1.02 * limit)


def growth(options: Options, key: str, gain: float) -> float:
    """Growth between two parts of a run, of the velocity, which the damper alone acts on."""
    given = options | {key: gain, "duration": 2.0, "stop_when": "wall.F > 1e6"}
    if key == DAMPING:
        given["linkage.start_velocity"] = {"rail": 0.01}
    run = hl.run("virtual-wall", given)
    assert run.fault is None
    _, early, _, late = np.array_split(np.abs(run["virtual_mechanism.rail.velocity"]), 4)
    return float(late.max() / early.max())


TABLE = [0.1810, 0.3273, 0.4435, 0.5333, 0.6000, 0.6462, 0.6741, 0.6857, 0.6828]
"""The largest alpha = K T^2/m for beta = B T/m = .1, .2, ... .9 without damping of the device."""


def test_the_lifted_map_has_the_table_of_a_sampled_damper() -> None:
    with SceneVariants(open_scene.load("virtual-wall", UNDAMPED)) as session:
        for n, alpha in enumerate(TABLE, start=1):
            gains = [f"{DAMPING}={n / 10 * M / T}"]
            for share, verdict in ((0.995, "stable"), (1.005, "unstable")):
                K = share * alpha * M / T**2
                assert session.judge([*gains, f"{STIFFNESS}={K}"]).verdict == verdict


@pytest.mark.parametrize(("n", "alpha"), list(enumerate(TABLE, start=1)))
def test_runs_grow_beyond_the_table(n: int, alpha: float) -> None:
    options = UNDAMPED | {DAMPING: n / 10 * M / T}
    assert growth(options, STIFFNESS, 0.98 * alpha * M / T**2) < 1
    assert growth(options, STIFFNESS, 1.02 * alpha * M / T**2) > 1


def test_a_unilateral_wall_has_the_same_limit_in_contact() -> None:
    """The scene as it is: the equilibrium lies within the wall, the start outside of it."""
    limit = wall_limits.stable(M, D, T)
    for share, verdict in ((0.995, "stable"), (1.005, "unstable")):
        found = own_hand("virtual-wall", {STIFFNESS: share * limit})
        assert found.verdict == verdict
        assert found.point["virtual_mechanism.q[1]"] == pytest.approx(2 / (share * limit))


def test_a_quantised_wall_chatters_beyond_its_limit() -> None:
    """The hand pushes with a force midway between those of two quanta: from rest, friction holds
    the handle up to K quantum = 2 f_c."""
    friction, quantum = 0.1, 0.18e-3
    limit = wall_limits.limit_with_quantum(D, T, friction, quantum)

    def speed(K: float) -> float:
        options = {
            STIFFNESS: K,
            "fmu.wall.settings.quantum": quantum,
            "linkage.joint.rail.friction": friction,
            "linkage.start": {"rail": 10.5 * quantum},
            "hand.wrench": [K * quantum * 10.5, 0.0, 0.0],
        }
        return float(np.abs(hl.run("virtual-wall", options)["virtual_mechanism.v"][-100:]).max())

    assert speed(0.98 * limit) < 1e-9
    assert speed(1.02 * limit) > 1e-5


def test_a_damper_whose_velocity_nothing_feeds_is_refused() -> None:
    options = {"fmu.wall.settings.damping": 5.0, "fmu.wall.settings.velocity": "measured"}
    with pytest.raises(hl.SceneFault, match=r"nothing feeds wall\.v"):
        hl.scene("virtual-wall", options)
    hl.scene("virtual-wall", options | {"fmu.wall.start.v": 0.0})
