import numpy as np
import pytest

from hapticlink.components.port_space import LINE, PLANE, PortSpace

POINT = PortSpace(("x", "y", "z"), (0, 1, 2))
POSE = PortSpace(("x", "y", "z", "roll", "pitch", "yaw"), (0, 1, 2, 3, 4, 5))


@pytest.mark.parametrize("space", [LINE, PLANE, POINT, POSE])
def test_a_wrench_over_an_acceleration_is_an_inertia(space: PortSpace) -> None:
    """Units agree with one another: F = M a and v' F is a power, entry by entry."""
    assert len(space.names) == space.size
    for quantity in (space.pose, space.twist, space.wrench, space.mass):
        assert quantity.shape == (space.size,) == (len(quantity.units),)
    turns = np.add.outer(space.turns, space.turns, dtype=int).ravel()
    assert space.inertia.units == tuple(("kg", "kg.m", "kg.m2")[n] for n in turns)
    assert space.mobility.units == tuple(("1/kg", "1/(kg.m)", "1/(kg.m2)")[n] for n in turns)
    assert space.mass.units == tuple(space.inertia.units[:: space.size + 1])
    assert np.reshape(space.identity, space.inertia.shape).tolist() == np.eye(space.size).tolist()


def test_lengths_and_angles_are_measured_apart() -> None:
    rows = np.array([[3.0, -4.0, -0.5], [0.0, 0.0, 2.0]])
    assert PLANE.distance(rows).tolist() == [5.0, 0.0]
    assert PLANE.angle(rows).tolist() == [0.5, 2.0]
    assert POINT.distance(np.array([2.0, 3.0, 6.0])) == pytest.approx(7.0, rel=1e-15)
    assert POINT.angle(rows).tolist() == [0.0, 0.0]
    assert PLANE.scaling(0.2) == [1, 1, 0.2]
    assert PLANE.difference(rows[0], rows[1]).tolist() == [3.0, -4.0, -2.5]
