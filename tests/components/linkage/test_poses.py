"""Places of bodies against closed forms."""

import numpy as np

from hapticlink.components.linkage.poses import poses
from hapticlink.components.specs.linkage import Body, Joint, Linkage, OperationalPoint


def test_two_links_and_a_slider() -> None:
    """A link about the origin, a second one on its end, and a slider along an axis of the second:
    sums of rotated vectors."""
    slide = {"type": "prismatic", "at_parent": (0.4, 0.0), "axis": 0.5}
    linkage = Linkage(
        body=tuple(Body(name=n, mass=1.0, inertia=0.1) for n in "abc"),
        joint=(
            Joint(name="first", child="a"),
            Joint(name="second", parent="a", child="b", at_parent=(0.3, 0.1), at_child=(-0.2, 0.0)),
            Joint(name="slide", parent="b", child="c", **slide),
        ),
        operational_point=OperationalPoint(body="c"),
    )
    first, second, slid = q = np.array([[0.7, 2.5], [-1.9, 0.4], [0.25, -0.1]])
    turned = np.exp(1j * (first + second))
    b = (0.3 + 0.1j) * np.exp(1j * first) + 0.2 * turned
    c = b + (0.4 + slid * np.exp(0.5j)) * turned
    expected = {"a": (0 * b, first), "b": (b, first + second), "c": (c, first + second)}
    places = poses(linkage, q.T)
    for body, (place, angle) in expected.items():
        exact = np.column_stack([place.real, place.imag, angle])
        np.testing.assert_allclose(places[body], exact, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(places["ground"], np.zeros((2, 3)))
