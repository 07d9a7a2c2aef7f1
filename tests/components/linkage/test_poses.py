"""Places of bodies against closed forms."""

import numpy as np

from hapticlink.components.linkage.poses import poses
from hapticlink.components.specs.linkage import Body, Joint, Linkage, OperationalPoint


def test_two_links_and_a_slider() -> None:
    """A link about the origin, a second one on its end, and a slider along an axis of the second:
    sums of rotated vectors."""
    bodies = tuple(Body(name=n, mass=1.0, inertia=0.1) for n in ("a", "b", "c"))
    joints = (
        Joint(name="first", child="a"),
        Joint(name="second", parent="a", child="b", at_parent=(0.3, 0.1), at_child=(-0.2, 0.0)),
        Joint(
            name="slide", type="prismatic", parent="b", child="c", at_parent=(0.4, 0.0), axis=0.5
        ),
    )
    linkage = Linkage(body=bodies, joint=joints, operational_point=OperationalPoint(body="c"))
    q = np.array([[0.7, -1.9, 0.25], [2.5, 0.4, -0.1]])
    found = poses(linkage, q)
    for row, (first, second, slide) in enumerate(q):
        elbow = (0.3 + 0.1j) * np.exp(1j * first)
        turned = np.exp(1j * (first + second))
        b = elbow + 0.2 * turned
        c = b + (0.4 + slide * np.exp(0.5j)) * turned
        for body, place, angle in (("a", 0j, first), ("b", b, first + second)):
            np.testing.assert_allclose(
                found[body][row], [place.real, place.imag, angle], rtol=0, atol=1e-15
            )
        np.testing.assert_allclose(
            found["c"][row], [c.real, c.imag, first + second], rtol=0, atol=1e-15
        )
    np.testing.assert_array_equal(found["ground"], np.zeros((2, 3)))
