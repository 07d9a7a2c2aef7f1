"""The hold along a gradient, alone and in the loop."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hapticlink as hl
from tests.orchestrator.holds.bench import Bench

ENTRIES, COORDINATES = 9, 2


def bench(matrix=None, factor=1.0):
    made = Bench(COORDINATES)
    reader = made.reader(range(COORDINATES), factor)
    return made, made.hold("model", ENTRIES, matrix=matrix, beside=reader)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_it_goes_on_along_the_gradient_whatever_the_age(seed):
    rng = np.random.default_rng(seed)
    factor = rng.uniform(0.5, 2, COORDINATES)
    made, hold = bench(factor=factor)
    for tick in (0, 30, 47):
        y, q, G = rng.normal(size=ENTRIES), rng.normal(size=COORDINATES), rng.normal(size=(9, 2))
        hold.push(tick, np.concatenate([y, q, G.ravel()]), tick + 3)
        for later in (3, 20):
            made.values[:] = rng.normal(size=COORDINATES)
            expected = y + G @ (factor * made.values - q)
            np.testing.assert_allclose(hold.value(tick + later, 0.5), expected, rtol=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_matrix_keeps_its_kind_and_changes_by_a_quarter_at_most(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    Lambda = root @ root.T
    made, hold = bench("semidefinite")
    G = rng.normal(size=(3, 3, 2))
    G = G + G.transpose(1, 0, 2)
    hold.push(0, np.concatenate([Lambda.ravel(), np.zeros(2), G.ravel()]), 0)
    scale = np.sqrt(np.diag(Lambda))
    whole = Lambda / np.outer(scale, scale)
    for far in (1e-3, 1.0, 1e6):
        made.values[:] = far * rng.normal(size=2)
        change = (G @ made.values) / np.outer(scale, scale)
        change *= min(1.0, np.linalg.norm(whole) / 4 / np.linalg.norm(change))
        values, vectors = np.linalg.eigh(whole + change)
        nearest = vectors @ np.diag(np.maximum(values, 0)) @ vectors.T * np.outer(scale, scale)
        np.testing.assert_allclose(
            hold.value(0).reshape(3, 3), nearest, atol=1e-9 * np.abs(Lambda).max()
        )


DRAWS = [(seed, rate) for seed in range(3) for rate in (10, 30)]


def test_it_follows_the_mechanism_better_than_holds_in_time():
    """With Coriolis compensation, over drawn wrenches: the median of the largest distances beyond
    that of a mechanism which computes its own matrices."""
    beyond = {hold: [] for hold in ("zoh", "foh", "second-order", "model")}
    for seed, rate in DRAWS:
        rng = np.random.default_rng(seed)
        wave = {
            "amplitude": [*rng.uniform(0.1, 0.6, 2), 0.0],
            "frequency": [*rng.uniform(0.3, 1.5, 2), 1.0],
        }
        changes = {"hand": {"type": "profile", "table": wave}, "duration": 0.5}
        changes |= {"controller.bias": "full", "graphics.rate": rate}
        own = hl.run("closed-loop-ideal", changes | {"directions_from": "mechanism"})
        for hold, found in beyond.items():
            run = hl.run("closed-loop-ideal", changes | {"hold": hold})
            found.append(run.tracking().distance_mm.max() - own.tracking().distance_mm.max())
    median = {hold: np.median(found) for hold, found in beyond.items()}
    assert median["model"] < 0.4 * min(median["zoh"], median["foh"], median["second-order"])


def test_where_no_gradient_is_declared_it_does_not_fit():
    pulled = {"hold": "model", "graphics.sync": "operational", "duration": 0.1}
    with pytest.raises(hl.SceneFault, match="does not put out the gradient of P_c"):
        hl.run("closed-loop-ideal", pulled)


def test_nothing_of_it_is_in_a_scene_that_does_not_use_it():
    given = {"duration": 0.1, "record": {"signals": "all"}}
    columns = ("gradient", "predicted")
    plain, held = (hl.run("closed-loop-ideal", given | {"hold": h}) for h in ("zoh", "model"))
    for run, there in ((plain, False), (held, True)):
        assert any(word in name for name in run["graphics"].columns for word in columns) == there
