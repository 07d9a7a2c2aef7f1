"""A tableau that does not add up is refused, whichever of its coefficients is wrong."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.components.integrators.dormand_prince_8 import DORMAND_PRINCE_8
from hapticlink.components.integrators.heun import HEUN
from hapticlink.components.integrators.rk4 import RK4
from hapticlink.components.integrators.runge_kutta import Tableau


@given(st.sampled_from([HEUN, RK4, DORMAND_PRINCE_8]), st.data())
def test_a_coefficient_that_is_off(tableau, data):
    """By as little as 1e-9."""
    off = data.draw(st.sampled_from([1e-9, -0.1, 1.0]))
    stages = len(tableau.b)
    i = data.draw(st.integers(1, stages - 1))
    j = data.draw(st.integers(0, i - 1))
    rows = [list(row) for row in tableau.a]
    rows[i][j] += off
    with pytest.raises(ValueError, match=f"row {i + 1} of a should sum to c"):
        replace(tableau, a=tuple(map(tuple, rows)))
    b = tuple(weight + off * (k == i) for k, weight in enumerate(tableau.b))
    with pytest.raises(ValueError, match="b should sum to 1 "):
        replace(tableau, b=b)


@pytest.mark.parametrize("tableau", [HEUN, RK4, DORMAND_PRINCE_8])
def test_an_order_that_is_claimed(tableau):
    with pytest.raises(ValueError, match=f"should sum to 1/{tableau.order + 1} for order"):
        replace(tableau, order=tableau.order + 1)


@pytest.mark.parametrize(
    ("a", "b", "c"),
    [
        (((0.0,), (0.5,)), (0.0, 1.0), (0.0, 0.5)),  # implicit
        (((),), (0.0, 1.0), (0.0, 0.5)),
        (((), (0.5,)), (0.0, 1.0), (0.5,)),
    ],
)
def test_sizes_that_do_not_fit(a, b, c):
    with pytest.raises(ValueError, match="an explicit method has"):
        Tableau(a, b, c, 1)
