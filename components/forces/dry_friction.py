"""Coulomb friction that sticks: a slider in series with a spring and a damper.

    e  = clip(z + tau v, -d, d)        v: rate of the sliding surfaces, z: deflection of the spring
    F  = -k e                          |F| <= k d, the friction
    z' = (e - z)/tau

Where |z + tau v| < d the slider sticks: z' = v, and F = -k z - k tau v is an elastic force that
holds its place for any time; nothing creeps. Otherwise it slides: |F| = k d at any speed, and z
follows to +-d within tau. It is not stiffer at high speeds, and it dissipates: -F v >= (k z^2/2)'.

Kikuuwe, Takesue, Sano, Mochiyama, Fujimoto, IEEE Trans. Robotics 22 (2006), 1176; without drift
before sliding as Dupont, Hayward, Armstrong, Altpeter, IEEE Trans. Automatic Control 47 (2002),
787, require.
"""

from __future__ import annotations

import casadi as ca

LAG = 4  # default of tau, in integration steps: of its modes in a step, none is faster than 1/4


def friction_effort(z: ca.SX, v: ca.SX, d: ca.SX, tau: ca.SX | float) -> ca.SX:
    """e, in the unit of the deflection z."""
    return ca.fmin(ca.fmax(z + tau * v, -d), d)


def deflection_rate(z: ca.SX, v: ca.SX, d: ca.SX, tau: ca.SX | float) -> ca.SX:
    """z'."""
    return (friction_effort(z, v, d, tau) - z) / tau
