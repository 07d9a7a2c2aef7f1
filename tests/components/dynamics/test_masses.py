"""Masses of any ratio: each loop is solved to its own rounding, whatever stands beside it.

All masses and inertias of a linkage times s leave its motion under gravity as it is, and its
multipliers and energy are times s: two five-bars that share nothing but the ground and the solve
move as each does alone.
"""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.blocks import Running, advance, running
from tests.mechanisms import five_bar

RATE = 512


def second(linkage):
    """The five-bar once more, with names of its own."""

    def name(body):
        return body if body == "ground" else f"other_{body}"

    return {
        "body": tuple(replace(b, name=name(b.name)) for b in linkage.body),
        "joint": tuple(
            replace(j, name=name(j.name), parent=name(j.parent), child=name(j.child))
            for j in linkage.joint
        ),
        "loop": tuple(replace(p, bodies=tuple(map(name, p.bodies))) for p in linkage.loop),
    }


ONE = replace(five_bar(), gravity=(0.0, -9.81))
START = {**ONE.start, **{f"other_{k}": v for k, v in ONE.start.items()}}
OTHER = second(ONE)
PAIR = replace(ONE, start=START, **{k: (*getattr(ONE, k), *v) for k, v in OTHER.items()})
MASSES = [(b.name, b.mass, b.inertia) for b in ONE.body]


def masses(prefix, factor):
    each = {f"{prefix}{name}.mass": m * factor for name, m, _ in MASSES}
    return each | {f"{prefix}{name}.inertia": inertia * factor for name, _, inertia in MASSES}


@settings(max_examples=15)
@given(st.floats(-4, 4), st.floats(-4, 4))
def test_two_linkages_move_as_each_alone(first, other):
    s = 10.0**first, 10.0**other
    alone = running(ONE)
    rest = alone.y["energy"]
    pair = Running(running(PAIR).component, parameters=masses("", s[0]) | masses("other_", s[1]))
    start = pair.y["energy"]
    y, one = (advance(block, 0.25, RATE).y for block in (pair, alone))
    for k, half in enumerate((slice(0, 4), slice(4, 8))):
        for name in ("q", "qd", "qdd"):
            size = np.abs(one[name]).max()
            np.testing.assert_allclose(y[name][half], one[name], rtol=0, atol=1e-10 * size)
        multipliers = y["lambda"][2 * k : 2 * k + 2] / s[k]
        np.testing.assert_allclose(multipliers, one["lambda"], rtol=1e-9)
    assert y["closure_error"] < 1e-15
    change = one["energy"] - rest
    np.testing.assert_allclose(y["energy"] - start, sum(s) * change, rtol=0, atol=1e-9 * sum(s))
