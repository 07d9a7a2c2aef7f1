"""[iteration]: how the plants of coupling = "iterated" come to agree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

INTERPOLATING = ("zoh", "foh", "second-order", "hermite")
"""Holds that interpolate once they have the sample at the end of the step."""


@dataclass(frozen=True, kw_only=True)
class Iteration:
    """Settings of [iteration].

    method: fixed point with Aitken's relaxation, or Newton. tolerance: outputs y agree where they
    differ by at most tolerance (1 + |y|). most: steps taken again for one step (those that make
    Newton's Jacobian not counted). interpolation: the hold on connections between plants of a
    rate: "zoh" their value at the end, "foh" linear from the start, "second-order", or "hermite",
    which needs derivatives ("foh" stands where there are none). unconverged: ends the run, or
    goes on with what there is.
    """

    method: Literal["aitken", "newton"] = "aitken"
    tolerance: float = 1e-9
    most: int = 50
    interpolation: Literal["zoh", "foh", "second-order", "hermite"] = "foh"
    unconverged: Literal["stop", "accept"] = "stop"
