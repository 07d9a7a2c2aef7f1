"""The classical Runge-Kutta method, order 4: Hairer, Norsett, Wanner, Solving Ordinary Differential
Equations I, II.1.

k_1 = f(t, x),               k_2 = f(t + h/2, x + h k_1/2),
k_3 = f(t + h/2, x + h k_2/2),   k_4 = f(t + h, x + h k_3)
x_{k+1} = x_k + h (k_1 + 2 k_2 + 2 k_3 + k_4)/6
"""

from hapticlink.components.integrators.runge_kutta import RungeKutta, Tableau

RK4 = Tableau(
    a=((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
    c=(0.0, 0.5, 0.5, 1.0),
    order=4,
)

METHOD = RungeKutta(RK4)
