"""Butcher tableaus (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1)."""

from hapticlink.components.integrators.runge_kutta import Tableau

HEUN = Tableau(a=((), (1.0,)), b=(0.5, 0.5), c=(0.0, 1.0), order=2)

RK4 = Tableau(
    a=((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
    c=(0.0, 0.5, 0.5, 1.0),
    order=4,
)
