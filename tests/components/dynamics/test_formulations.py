"""The mechanism's accelerations against three formulations of their own, at random poses of random
five-bars: multipliers, coordinate partitioning, and closed forms of the dependent coordinates."""

import numpy as np
import pytest

from benchmarks.five_bar import PAIRS, FiveBar
from benchmarks.formulations import cases
from benchmarks.our_mechanism import Ours
from hapticlink.components.specs.linkage import Mechanism
from tests.blocks import once

H = 1e-7  # s: a step of RK4 is H qdd + O(H^2)


@once
def bars() -> list[tuple[int, FiveBar, np.ndarray]]:
    return [*cases(5)]


@pytest.mark.parametrize("case", range(5))
def test_four_formulations_have_one_acceleration(case: int) -> None:
    _, bar, start = bars()[case]
    expected = bar.multipliers(start)[4:]
    scale = np.abs(expected).max() + 1.0
    _, _, W, w, h = (np.array(v) for v in bar.tree(start[:4], start[4:]))
    assert np.abs(h).max() < 1e-15
    assert np.abs(W @ expected[:, None] + w).max() < 1e-12 * scale
    steps = {pair: bar.partitioned(pair) for pair in PAIRS if _regular(W, pair)}
    steps["chosen"], steps["embedded"] = bar.repartitioned(), bar.embedded(bar.side(start))
    for name, step in steps.items():
        _, rates = step(start[:4], start[4:], H)
        got = (np.array(rates).ravel() - start[4:]) / H
        assert np.abs(got - expected).max() < 1e-5 * scale, name
    ours = Ours(bar.linkage(start[:4], start[4:]), bar.wrench, Mechanism(integrator="rk4"), H)
    after = np.array(ours.component.step(start, ours.u, ours.p, 0.0, H)).ravel()
    assert np.abs((after - start)[4:] / H - expected).max() < 1e-5 * scale


def _regular(W: np.ndarray, pair: tuple[int, int]) -> bool:
    return abs(np.linalg.det(W[:, pair])) > 1e-4


def test_a_closed_form_of_the_other_branch_is_another_linkage() -> None:
    _, bar, start = next(cases(1))
    q, _ = bar.embedded(-bar.side(start))(start[:4], start[4:], 0.0)
    assert np.abs(np.array(q).ravel() - start[:4]).max() > 0.01
