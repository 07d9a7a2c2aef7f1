"""Reference for one-sided contacts: SciPy's DOP853 from event to event, each found to rounding."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Vector = NDArray[np.float64]
SAME = 1e-9
"""Instants (s) that differ by less are one."""


def solve(
    rhs: Callable[[Vector, Vector], Vector],
    sides: Sequence[Callable[[Vector], tuple[float, float, float, float]]],
    y: Vector,
    t_end: float,
) -> tuple[Vector, int]:
    """(y(t_end), number of events) of y' = rhs(y, F) with F_i = max(0, -k g_i - b g_i') where
    g_i < 0; sides give (g, g', k, b) at y."""

    def push(i, y):
        g, rate, k, b = sides[i](y)
        return -k * g - b * rate

    def event(i, on):
        def value(t, y):
            return push(i, y) if on else max(sides[i](y)[0], -push(i, y))

        value.terminal, value.direction = True, -1
        return value

    pushing = [sides[i](y)[0] < 0 and push(i, y) > 0 for i in range(len(sides))]
    t, events = 0.0, 0
    changed = [-np.inf] * len(sides)
    while t < t_end:
        on = tuple(pushing)

        def f(t, y, on=on):
            return rhs(y, np.array([push(i, y) * on[i] for i in range(len(on))]))

        functions = [event(i, on[i]) for i in range(len(on))]
        found = solve_ivp(f, (t, t_end), y, "DOP853", rtol=1e-12, atol=1e-13, events=functions)
        t, y = found.t[-1], found.y[:, -1]
        for i, times in enumerate(found.t_events):
            # One that changes at the same instant may be past it by rounding, and is not found; nor
            # is one that has just changed before it, by rounding, to change back.
            if len(times) or (functions[i](t, y) < 0.0 and t - changed[i] > SAME):
                pushing[i], changed[i] = not pushing[i], t
                events += 1
    return y, events
