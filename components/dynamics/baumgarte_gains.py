"""Baumgarte's stabilisation of (3.3), hddot + 2 alpha beta hdot + alpha^2 h = 0: the gains of
`Integrator.baumgarte`.

The roots of the closure error times the step T are z = alpha T (-beta +- sqrt(beta^2 - 1)). A
Runge-Kutta method multiplies its modes by the stability polynomial R(z) in each step, so alpha T
has a limit, and the error that the terms introduce grows with it. Limits at beta = 1, and the
reason for each default:

    semi-implicit-euler   .83, 2 (sqrt(beta^2 + 1) - beta)    dead beat: both roots are 0
    heun                  2.0                                 dead beat: 1 + z + z^2/2 = 0
    rk4                   2.79                                smallest error of the tip, .02 to .05
    dormand-prince-8      6.4                                 gap at rounding from .05 to .2
    linearly-implicit     none                                error of the tip grows from .1 on

Gap of the five-bar at 512 Hz, in m, by alpha T at beta = 1 (0 is unstabilised):

                                            0       .02     .05     .1      .5      dead beat
    rk4, 3 s under the wrench of chapter 6  2e-8    7e-10   5e-10   2e-9    7e-8
    rk4, 60 s undamped, 12.6 mJ             2e-8    3e-11   2e-10   6e-10
    heun, 60 s undamped                     3.5e-6                                  1e-8
    semi-implicit Euler, 20 s undamped      1.9e-2                                  2e-6
"""

from __future__ import annotations

from hapticlink.components.integrators.base import Baumgarte

HELD = Baumgarte(0.4, 1.0)
"""Gains of the local model, with T the frame period: W is up to a frame old, so that a faster
correction overshoots. Projection with held matrices diverges for the same reason."""
