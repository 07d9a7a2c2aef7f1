"""Passive set-position modulation (Lee & Huang, IEEE Trans. Robotics 26(4), 2010).

Where held samples are the set position y (and set velocity w) of a spring-damper on the fast side,

F = K (y - x) + B (w - v),    x the local position, v = dx/dt,

each new sample switches the energy of the spring. This hold modulates the set position so that the
switch costs no more than the available energy. At a tick t_k, with e = y - x(t_k),

output:  x(t_k) + s e and s w,    s = min(1, sqrt(A_k / N)),    N = 1/2 e'Ke + T/4 w'Bw

A_k is the available energy: that of the tank and that stored in the spring. It starts with the
spring's, A_0 = V_0 = 1/2 e_0'K e_0, and over a step T_k <= T grows by a lower bound of the energy
that the local side puts in,

A_{k+1} = A_k + V(x_{k+1}) - V(x_k) + dx'B dx / T_k - w'B dx    (V and w of the output at t_k)

since the spring stores V(x_{k+1}) - V(x_k) on any path, and integral v'Bv dt >= dx'B dx / T_k
(Cauchy-Schwarz; the paper's D_min). It never becomes negative: A_k >= V(x_k) + T/4 w'Bw, so that
A_{k+1} >= V(x_{k+1}) + |sqrt(T_k)/2 w - dx/sqrt(T_k)|^2_B >= V(x_{k+1}), and the same at any
instant within the step. So at every instant, for any motion and for any samples at any rate, the
work of F on the local side is at most V_0 - V: the hold generates no energy.

The energy that the fast side generates by sampling F itself comes in addition, 1/2 dx'K dx a step
(Colgate & Schenkel 1997 require B > K T/2 for it).
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
        self.tank, self.row = context.tank

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self.tank.newest[self.row] = sample

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self.tank.modulated(tick)[self.row]
