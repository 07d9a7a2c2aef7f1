"""The classical Runge-Kutta method, order 4: Hairer, Norsett, Wanner, Solving Ordinary Differential
Equations I, II.1.

k_1 = f(t, x),               k_2 = f(t + h/2, x + h k_1/2),
k_3 = f(t + h/2, x + h k_2/2),   k_4 = f(t + h, x + h k_3)
x_{k+1} = x_k + h (k_1 + 2 k_2 + 2 k_3 + k_4)/6

Baumgarte is stable for alpha h < 2.79 at beta = 1 (2.62 at 1/2, 1.17 at 1.4), but the error that it
brings grows with alpha. Gap of the five-bar at 512 Hz, beta = 1, in m:

    alpha h                               0      .02     .05     .1      .5
    3 s under the wrench of chapter 6     2e-8   7e-10   5e-10   2e-9    7e-8
    60 s undamped, 12.6 mJ                2e-8   3e-11   2e-10   6e-10

The tip errs least at .05 in the first and at .02 in the second.
"""

from hapticlink.components.integrators.base import Baumgarte
from hapticlink.components.integrators.runge_kutta import RungeKutta, Tableau

RK4 = Tableau(
    a=((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
    c=(0.0, 0.5, 0.5, 1.0),
    order=4,
)

METHOD = RungeKutta("rk4", RK4, Baumgarte(alpha_h=0.05, beta=1.0))
