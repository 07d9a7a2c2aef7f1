"""What the study compares: holds, gains of the virtual coupling, and integrators."""

from __future__ import annotations

from typing import NamedTuple

from hapticlink.analysis.advise.methods import GAINS, HOLDS

RATES = {"10": "512/51", "20": "512/26", "30": "512/17", "57": "512/9"}
"""Graphics rates (Hz): whole haptic ticks a frame, so that the lifted map spans one frame."""
VARIABLE, LOW, HIGH = "10..60", 10, 60
COLUMNS = (*RATES, VARIABLE)
KEPT_APART = "24"
"""A rate at which nothing is chosen, whose frames are no whole ticks."""
BIAS = ("none", "full")
OF_MATRICES = ("zoh", "foh", "second-order", "delayed")
"""Holds that are tried on Lambda^-1 and P_c."""

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
