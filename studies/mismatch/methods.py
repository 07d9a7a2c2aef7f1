"""What the study compares: holds, gains of the virtual coupling, and integrators."""

from __future__ import annotations

from typing import NamedTuple

RATES = {"10": "512/51", "20": "512/26", "30": "512/17", "57": "512/9"}
"""Graphics rates (Hz): whole haptic ticks a frame, so that the lifted map spans one frame."""
VARIABLE, LOW, HIGH = "10..60", 10, 60
COLUMNS = (*RATES, VARIABLE)
KEPT_APART = "24"
"""A rate at which nothing is chosen, whose frames are no whole ticks."""
BIAS = ("none", "full")
PASSIVE = tuple(f"holds.virtual_mechanism.{w}=passive" for w in ("F_hand", "F_drift"))
SLOPE = (
    'holds."virtual_mechanism.x -> controller.x_S"=foh',
    'holds."virtual_mechanism.v -> controller.v_S"=slope',
)

HOLDS: dict[str, tuple[str, ...]] = {
    "zoh": ("hold=zoh",),
    "foh": ("hold=foh",),
    "foh-derivative": ("hold=foh-derivative",),
    "foh, slope": ("hold=foh", *SLOPE),
    "second-order": ("hold=second-order",),
    "delayed": ("hold=delayed",),
    "zoh, mean": ("hold=zoh", "downsampling=mean"),
    "passive": ("hold=passive",),
    "foh-derivative, passive": ("hold=foh-derivative", *PASSIVE),
    "pspm, passive": ("hold=pspm", *PASSIVE),
}
"""From the simplest on: of equally good ones the first is advised. `a, b`: hold a from slow to
fast, b from fast to slow (`slope`: of the velocity, from slow to fast)."""
OF_MATRICES = ("zoh", "foh", "second-order", "delayed")
"""Holds that are tried on Lambda^-1 and P_c."""

GAINS: dict[str, tuple[str, ...]] = {
    name: (f"controller.teleoperation.stiffness={k}", f"controller.teleoperation.damping={b}")
    for name, k, b in (
        ("soft", [25.0, 25.0, 0.01], [5.0, 5.0, 0.002]),
        ("medium", [100.0, 100.0, 0.1], [20.0, 20.0, 0.02]),
        ("stiff", [100.0, 100.0, 0.5], [70.0, 70.0, 0.375]),
    )
}
"""K_pc and B_pc; stiff: those of section B.6; medium: those of the scene closed-loop-direct."""
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
