"""A function of CasADi for many rows."""

import casadi as ca
import numpy as np

from hapticlink.components.evaluate_rows import evaluate_rows


def test_functions_and_numbers_of_rows_are_told_apart() -> None:
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y", 1)
    product, total = (ca.Function("f", [x, y], [of]) for of in (x * y, ca.sum1(x) + y))
    for count in (3, 5, 3):
        at, factor = np.random.default_rng(count).random((2, count, 2)), np.full((count, 1), 2.0)
        assert np.array_equal(evaluate_rows(product, at[0], factor), 2 * at[0])
        assert np.allclose(evaluate_rows(total, at[1], factor)[:, 0], at[1].sum(axis=1) + 2)
