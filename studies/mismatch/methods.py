"""What the study compares: holds, gains of the virtual coupling, and integrators."""

from __future__ import annotations

from typing import NamedTuple

from hapticlink.analysis.search.settings import EARLY, GAINS, HOLDS

TICKS = (51, 34, 26, 20, 17, 15, 13, 11, 10, 9, 8)
RATES = {f"{512 / ticks:.0f}": f"512/{ticks}" for ticks in TICKS}
"""Graphics rates (Hz), those next to 10, 15, ..., 60 with whole haptic ticks a frame, so that the
lifted map spans one frame."""
VARIABLE, LOW, HIGH = "10..60", 10, 60
COLUMNS = (*RATES, VARIABLE)
FEW = ("10", "30", "57", VARIABLE)
"""The rates at which all is tried, without Coriolis compensation; elsewhere of the holds LIKELY,
and neither the report's gains nor the integrators."""
LIKELY = ("zoh", "foh", "second-order", "passive", "foh-derivative, passive", EARLY)
KEPT_APART, NEAREST = "22", "20"
"""A rate at which nothing is chosen, whose frames are no whole ticks, and the row it takes."""
BIAS = ("none", "full")
OF_MATRICES = ("zoh", "foh", "second-order", "delayed", "model")
"""Holds that are tried on Lambda^-1 and P_c."""
OF_MOTION = tuple(hold for hold in HOLDS if hold != "model")
"""Holds that are tried on what a mechanism at the graphics rate and its loop exchange, the hold
`model` with what it stands for in both directions."""

REPORT = "stiff"
INTEGRATORS = ("rk4", "semi-implicit-euler", "passive-midpoint")
COMPARED = ("zoh", "foh-derivative")
"""Holds with which the integrators are compared."""


class Method(NamedTuple):
    """A hold, gains and the integrator of the mechanism."""

    hold: str
    gains: str
    integrator: str = "rk4"

    @property
    def candidate(self) -> bool:
        """Whether it can be advised: the report's gains and other integrators are compared at FEW
        rates alone."""
        return self.gains != REPORT and self.integrator == "rk4"

    @property
    def options(self) -> tuple[str, ...]:
        own = (f"mechanism.integrator={self.integrator}",)
        return (*HOLDS[self.hold], *GAINS[self.gains], *own)


def rate_option(rate: str, seed: int) -> str:
    """The option of a graphics rate; `seed` draws the periods of the variable one."""
    if rate == VARIABLE:
        return f"graphics.rate={{ min = {LOW}, max = {HIGH}, seed = {seed} }}"
    return f'graphics.rate="{RATES.get(rate, rate)}"'


def order(method: Method) -> tuple[int, int, int]:
    """Simplest first: by hold, then from the report's gains down, then by integrator."""
    gains = list(GAINS)
    return (
        list(HOLDS).index(method.hold),
        -gains.index(method.gains),
        INTEGRATORS.index(method.integrator),
    )
