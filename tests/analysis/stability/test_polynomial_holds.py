"""Holds as linear systems of their own, against interpolating polynomials, and in scenes against
periods in which they are differentiated anew at each age of their samples."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from hapticlink.analysis.stability import forward_sensitivity
from hapticlink.analysis.stability.forward_sensitivity import ForwardSensitivity
from hapticlink.analysis.stability.linear_period import LinearPeriod
from hapticlink.analysis.stability.modes import modes
from hapticlink.analysis.stability.polynomial_holds import advanced_powers, slopes_of_powers
from hapticlink.analysis.stability.resting_scene import resting
from hapticlink.orchestrator.base.arrays import Matrix
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold
from hapticlink.orchestrator.run.compiled.state import StateBlock
from tests.analysis.stability.own_hand import linearised
from tests.orchestrator.holds.bench import Bench
from tests.orchestrator.holds.test_laws import LAWS

POINT = (0.044493, 0.014823, -0.788148)
FIRM = {"type": "spring", "stiffness": [1000.0, 1000.0, 3.0], "damping": [5.0, 5.0, 0.01]}
NOTHING = np.zeros(0)
"""What a hold reads that has nothing beside its samples."""
EARLY: dict[str, Any] = {"hold": "model", "downsampling": "model", "graphics.rate": 64}
EARLY |= {"directions_from": "mechanism", "controller.bias": "full"}
SCENE = {"graphics.rate": 60, "hand": {**FIRM, "target": [[0.0, *POINT]]}}  # frames of 8 or 9 ticks


@pytest.mark.parametrize("name", LAWS)
def test_a_hold_goes_on_from_its_powers_to_the_interpolating_polynomial(name: str) -> None:
    n, base, draw = 2, Fraction(3, 7680), np.random.default_rng(5)
    hold = Bench(n, base).hold(name, n)
    stamps = [0, 17, 33, 51]
    samples = draw.normal(size=(len(stamps), hold.width))
    for stamp, sample in zip(stamps, samples, strict=True):
        hold.push(stamp, sample, stamp)
    y, beside = samples[:, :n], samples[:, n:]
    block = StateBlock(hold.c)
    for tick in (51, 58):
        powers = slopes_of_powers(hold, block, NOTHING, tick, 0.5) @ block.save().numbers
        for dt in (0.0, 0.5, 9.5, 100.0):
            value = (advanced_powers(hold, dt) @ powers)[:n]
            expected = LAWS[name](stamps, y, beside, Fraction(tick) + Fraction(dt + 0.5))
            np.testing.assert_allclose(value, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("relation", ["WITH_RATE", "WITH_POSE", "ALONE"])
def test_both_laws_of_an_early_step_go_on_from_their_powers(relation: str) -> None:
    """Between the samples, and behind them, where efforts are read beside: along any direction the
    slope at a later instant is that of the powers."""
    n, draw = 2, np.random.default_rng(7)
    bench, size = Bench(2 * n, Fraction(3, 7680)), 2 * n + n * n + n
    further, signs = tuple(range(n, size)), np.repeat([1.0, -1.0], n)
    beside = bench.reader(range(2 * n), signs)
    hold = bench.hold("ahead", n, beside=beside, further=further, relation=relation)
    bench.values[:] = draw.normal(size=2 * n)
    for stamp in (0, 40):
        hold.push(stamp, draw.normal(size=size), 0)
    block = StateBlock(hold.c)
    state = block.save()
    along = draw.normal(size=len(state.numbers) + 2 * n)

    def value(tick: int, ahead: float, way: float) -> Matrix:
        size = len(state.numbers)
        block.restore(state, state.numbers + way * along[:size])
        bench.values[:] += way * along[size:]
        moved: Matrix = hold.value(tick, ahead).copy()
        block.restore(state, state.numbers)
        bench.values[:] -= way * along[size:]
        return moved

    for tick in (7, 40, 52):
        powers = slopes_of_powers(hold, block, bench.values, tick, 0.5) @ along
        for dt in (0.0, 3.0, 25.0):
            expected = (value(tick, 0.5 + dt, 1e-6) - value(tick, 0.5 + dt, -1e-6)) / 2e-6
            told = (advanced_powers(hold, dt) @ powers)[:n]
            np.testing.assert_allclose(told, expected, rtol=1e-6, atol=1e-6)


def leading(period: LinearPeriod) -> list[complex]:
    return [mode.z for mode in modes(period.linear, period.map_.period)[:6]]


@pytest.mark.parametrize(
    "changes",
    [
        {"hold": "zoh"},
        {"hold": "lead"},
        {"hold": "foh"},
        {"hold": "second-order"},
        {"hold": "mean"},
        {"downsampling": "half-lead"},
        {"hold": "mean", "delays": {"virtual_mechanism.x -> controller.x_S": 3 / 512}},
        {"hold": "foh", "delays": {"virtual_mechanism.x -> controller.x_S": 3 / 512}},
        {"hold": "lead", "delays": {"controller.F_drift -> virtual_mechanism.F_drift": 7 / 1024}},
        EARLY,
        EARLY | {"computing_time": 3 / 512},
    ],
    ids=str,
)
def test_a_period_is_that_in_which_each_evaluation_is_differentiated(
    changes: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    options = SCENE | changes
    with resting("closed-loop-direct", options) as place:
        found, differentiated = leading(place.period({})), place.map.work.counts["differentiated"]
        fused = leading(place.period({}).fused(["hand"]))
    monkeypatch.setattr(forward_sensitivity, "is_polynomial", lambda hold: False)
    with resting("closed-loop-direct", options) as place:
        anew = leading(place.period({}))
        assert place.map.work.counts["differentiated"] > differentiated
    assert found == pytest.approx(anew, abs=1e-7)
    assert fused == pytest.approx(found, abs=1e-9)


@pytest.mark.parametrize("rate", ["1024/17", "512/26"])  # periods of 17 and 26 ticks
def test_along_the_coordinates_of_a_gradient_a_hold_has_slopes(
    rate: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def found() -> list[complex]:
        options = SCENE | {"hold": "model", "graphics.rate": rate}
        with resting("closed-loop-ideal", options) as place:
            return leading(place.period({}))

    declared = found()
    is_smooth = ForwardSensitivity._is_smooth
    monkeypatch.setattr(
        ForwardSensitivity,
        "_is_smooth",  # others read and write all signals
        lambda self, name: not self._simulation.holds[name].parts.beside and is_smooth(self, name),
    )
    assert declared == pytest.approx(found(), abs=1e-7)


@pytest.mark.parametrize(
    "changes",
    [{}, {"downsampling": "latest"}, {"computing_time": 0.02}, {"coupling": "jacobi"}],
    ids=str,
)
def test_early_steps_have_the_modes_of_the_whole_map(changes: dict[str, Any]) -> None:
    """Slopes of single operations, against differences of the whole period along each number."""
    options = SCENE | {"hold": "model", "downsampling": "model", "controller.bias": "full"}
    options |= {"directions_from": "mechanism", "graphics.rate": 16, "haptics.rate": 512}
    with resting("closed-loop-direct", options | changes) as place:
        assert place.map.system.early
        period = place.period({})
        whole = linearised(place.map, period.point)
        parts, both = (np.abs(np.linalg.eigvals(at.A)) for at in (period.in_map, whole))
        assert np.sort(parts)[-6:] == pytest.approx(np.sort(both)[-6:], abs=1e-5)


@pytest.mark.parametrize(
    ("matrix", "second"), [("semidefinite", 0.0), ("semidefinite", 1e-4), ("projector", 0.0)]
)
def test_behind_a_manifold_slopes_are_those_of_samples_that_keep_their_rank(
    matrix: str, second: float
) -> None:
    """At rest, where all samples are the same: an entry that moves alone leaves the rank, where a
    semidefinite matrix has a slope to one side only, and turns the eigenvector of a `second`
    eigenvalue that is small. Along what keeps the rank that of the hold is told all the same."""
    draw = np.random.default_rng(3)
    (u, v), others = np.linalg.qr(draw.normal(size=(3, 3)))[0][:2], draw.normal(size=(3, 2, 3))

    def pushed(far: float) -> CompiledHold:
        hold = Bench(9, Fraction(3, 7680)).hold("second-order", 9, matrix=matrix)
        for stamp, (to, beside) in zip((0, 17, 33), others, strict=True):
            w, b = u + far * to, v + far * beside
            size = w @ w if matrix == "projector" else 1.0
            hold.push(stamp, ((np.outer(w, w) + second * np.outer(b, b)) / size).ravel(), stamp)
        return hold

    def numbers(hold: CompiledHold) -> Matrix:
        state: Matrix = StateBlock(hold.c).save().numbers
        return state

    far, tick, ahead = 1e-7, 41, 0.5
    there, back = pushed(far), pushed(-far)
    at = pushed(0.0)
    powers = slopes_of_powers(at, StateBlock(at.c), NOTHING, tick, ahead)[:9]
    told = powers @ (numbers(there) - numbers(back))
    moved = there.value(tick, ahead) - back.value(tick, ahead)
    np.testing.assert_allclose(told, moved, atol=1e-6 * far)
