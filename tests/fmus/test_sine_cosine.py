"""Sine and cosine as arithmetic, beside the functions of mpmath."""

import casadi as ca
import numpy as np
import pytest
from mpmath import mp

from hapticlink.components.time_signals import LookUp
from hapticlink.fmus.fmu_functions import _without_simplification
from hapticlink.fmus.sine_cosine import sine_cosine, with_own_sines

DRAW = np.random.default_rng(1)
QUARTERS = np.concatenate([np.arange(-40.0, 41.0), DRAW.integers(-(2**29), 2**29, 300)])
ARGUMENTS = {
    "angles": DRAW.uniform(-8.0, 8.0, 1500),
    "large": DRAW.uniform(-8e8, 8e8, 500),
    "small": 10.0 ** DRAW.uniform(-320.0, 0.0, 200),
    "near multiples of pi/2": QUARTERS * np.pi / 2,
}


@pytest.fixture(scope="module")
def own():
    x = ca.SX.sym("x")
    with _without_simplification():
        return ca.Function("own", [x], sine_cosine(x))


@pytest.mark.parametrize("kind", ARGUMENTS)
def test_both_are_within_one_ulp(own, kind):
    """Of numbers beside multiples of pi/2, too, where one of both is as small as 1e-17."""
    x = ARGUMENTS[kind]
    got = np.concatenate([np.asarray(part) for part in own(x.reshape(1, -1))])
    with mp.workprec(400):
        exact = [[f(mp.mpf(float(v))) for v in x] for f in (mp.sin, mp.cos)]
        ulp = np.spacing(np.abs(np.array(exact, dtype=float)))
        entries = zip(got.ravel(), [*exact[0], *exact[1]], ulp.ravel(), strict=True)
        assert max(abs(mp.mpf(float(g)) - e) / mp.mpf(float(u)) for g, e, u in entries) < 1


def test_what_is_no_number_gives_none(own):
    for x in (np.inf, -np.inf, np.nan):
        assert np.isnan(np.array(own(x), dtype=float)).all()
    assert [float(part) for part in own(0.0)] == [0.0, 1.0]


def test_functions_keep_all_but_their_sines():
    """Look-ups and their slopes, conditions and sparse results."""
    table = LookUp(np.linspace(0.0, 1.0, 5), np.array([[0.0], [1.0], [0.5], [2.0], [3.0]]))
    x = ca.SX.sym("x", 2)
    waves = ca.sin(x[0]) * ca.cos(x[0]) + ca.sin(x[0])
    sparse = ca.SX(ca.Sparsity.diag(2), ca.vertcat(ca.sin(x[1]), 2.0))
    chosen = ca.if_else(x[1] > 0.3, x[1], ca.cos(x[1]))
    results = [ca.vertcat(waves, chosen), sparse, table.value(x[1]), table.slope(x[1])]
    f = ca.Function("f", [x], results, ["x"], ["y", "s", "v", "d"])
    with _without_simplification():
        made = with_own_sines(f)
    codes = [made.instruction_id(k) for k in range(made.n_instructions())]
    assert not {ca.OP_SIN, ca.OP_COS} & {*codes}
    for point in ([0.2, 0.1], [-3.0, 0.4]):
        for ours, its in zip(made(point), f(point), strict=True):
            assert ours.sparsity() == its.sparsity()
            np.testing.assert_allclose(np.array(ours), np.array(its), rtol=1e-15, atol=1e-16)
    assert (made.name_in(), made.name_out()) == (f.name_in(), f.name_out())
