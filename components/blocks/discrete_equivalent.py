"""A first-order system with a complex pole, discretised by a rule of section 1.3.1.

    xdot = s x,  s = re + i im,  as a real system of two states (Re x, Im x)

One step from x(0) = 1 puts out z = x(1), the image of the pole: figure 1.4 measured.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.device import discretisation


def discrete_equivalent(rule: str) -> Component:
    """The FMU `discrete_equivalent`. Raises ValueError for an unknown rule."""
    discretisation.weight(rule)
    block = Block(
        parameters=[
            Variable("re", (), "1/s", -1.0, "real part of the pole"),
            Variable("im", (), "1/s", 0.0, "imaginary part of the pole"),
        ],
        states=[Variable("x", (2,))],
        outputs=[Variable("x", (2,), description="real and imaginary part of the state")],
    )
    re, im = block.p["re"], block.p["im"]
    A = ca.vertcat(ca.horzcat(re, -im), ca.horzcat(im, re))
    nothing = ca.SX(0, 1)
    x = discretisation.step(rule, A, ca.SX(2, 0), block.x["x"], nothing, nothing, block.h)
    return block.component(
        "discrete_equivalent",
        f"A complex pole under the {rule} rule",
        "continuous",
        initial={"x": ca.SX([1, 0])},
        step={"x": x},
        output={"x": block.x["x"]},
        documentation=__doc__ or "",
    )
