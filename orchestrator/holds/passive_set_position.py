"""Passive set-position modulation (Lee & Huang, IEEE Trans. Robotics 26(4), 2010).

Where held samples are the set position y (and set velocity w) of a spring-damper on the fast side,

F = K (y - x) + B (w - v),    x the local position, v = dx/dt,

a new sample switches the energy of the spring from one value to another. Here what is given of it
is limited by the energy that the spring-damper has at hand. At a tick t_k, with e = y - x(t_k),

given:  x(t_k) + s e and s w,    s = min(1, sqrt(A_k / N)),    N = 1/2 e'Ke + T/4 w'Bw

A_k is that energy: the tank's and what the spring itself holds. It starts as the spring's own,
A_0 = V_0 = 1/2 e_0'K e_0, and over the step T_k <= T takes in what the local side gives, at least

A_{k+1} = A_k + V(x_{k+1}) - V(x_k) + dx'B dx / T_k - w'B dx    (V and w of what was given at t_k)

since the spring takes V(x_{k+1}) - V(x_k) on any path, and integral v'Bv dt >= dx'B dx / T_k
(Cauchy-Schwarz; the paper's D_min). It never runs out: A_k >= V(x_k) + T/4 w'Bw, so that
A_{k+1} >= V(x_{k+1}) + |sqrt(T_k)/2 w - dx/sqrt(T_k)|^2_B >= V(x_{k+1}), and the same at any
instant within the step. So at every instant, on any motion and for any samples at any rate, the
work of F on the local side is at most V_0 - V: the hold creates nothing.

What the fast side makes by sampling F itself comes on top, 1/2 dx'K dx a step (Colgate & Schenkel
1997 ask B > K T/2 for it).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.hold import Hold

Vector = NDArray[np.float64]


class PassiveSetPosition(Hold):
    needs = "spring"

    def __init__(self, context: HoldContext) -> None:
        assert context.tank is not None
        self._set_point, self._row = context.tank

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self._set_point.newest[self._row] = sample

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self._set_point.given(tick)[self._row]
