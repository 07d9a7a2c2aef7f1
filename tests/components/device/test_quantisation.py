"""Quantisation by encoders: counts, and none where the quantum is 0."""

import casadi as ca
import pytest

from hapticlink.components.device.motors_and_encoders import quantised

VALUE, QUANTUM = ca.SX.sym("value"), ca.SX.sym("quantum")


@pytest.mark.parametrize(("share", "counts"), [(0.0, -3), (0.5, -2)])
def test_counts_and_without_a_quantum_the_value_with_its_slope(share: float, counts: int) -> None:
    result = quantised(VALUE, QUANTUM, share)
    both = ca.Function("both", [VALUE, QUANTUM], [result, ca.jacobian(result, VALUE)])
    assert [float(v) for v in both(-0.6, 0.25)] == [0.25 * counts, 0.0]
    assert [float(v) for v in both(-0.6, 0.0)] == [-0.6, 1.0]
