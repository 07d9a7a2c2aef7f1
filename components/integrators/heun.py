"""Heun's method, order 2: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1.

k_1 = f(t, x),   k_2 = f(t + h, x + h k_1),   x_{k+1} = x_k + h (k_1 + k_2)/2
"""

import math

from hapticlink.components.integrators.base import Baumgarte
from hapticlink.components.integrators.runge_kutta import RungeKutta, Tableau

HEUN = Tableau(a=((), (1.0,)), b=(0.5, 0.5), c=(0.0, 1.0), order=2)

METHOD = RungeKutta(HEUN, Baumgarte(math.sqrt(2), math.sqrt(0.5)))
