"""The settings of a scene that are searched: gains, holds and rates.

Gains are stiffness and damping of each law, scaled with one damping ratio: a law with stiffness K
and damping B is scaled by s to s K and sqrt(s) B, which keeps its damping ratio B/(2 sqrt(K m)) on
any mass.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from hapticlink.orchestrator.base.signal_names import CONTROLLER, user_of_block
from hapticlink.orchestrator.base.ticks import write_exact
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.system.system import Fmu, System

LAWS = {
    "drift": ("teleoperation", "K_pc", "B_pc"),
    "topology": ("topology", "k_j", "b_j"),
}
"""By law: the table of a controller that has its `stiffness` and `damping`, and the parameters of
both."""
Scales = Mapping[str, float]
"""The scale s of each law, by name; 1 where it is missing."""
_PASSIVE = tuple(f"holds.virtual_mechanism.{w}=passive" for w in ("F_hand", "F_drift"))
_SLOPE = (
    'holds."virtual_mechanism.x -> controller.x_S"=foh',
    'holds."virtual_mechanism.v -> controller.v_S"=slope',
)
EARLY = "model, model"
"""Of a mechanism at the graphics rate alone, whose steps are then taken when they begin."""
HOLDS: dict[str, tuple[str, ...]] = {
    "zoh": ("hold=zoh",),
    "foh": ("hold=foh",),
    "foh-derivative": ("hold=foh-derivative",),
    "foh, slope": ("hold=foh", *_SLOPE),
    "second-order": ("hold=second-order",),
    "delayed": ("hold=delayed",),
    "model": ("hold=model",),
    EARLY: ("hold=model", "downsampling=model", "directions_from=mechanism"),
    "zoh, mean": ("hold=zoh", "downsampling=mean"),
    "passive": ("hold=passive",),
    "foh-derivative, passive": ("hold=foh-derivative", *_PASSIVE),
    "pspm, passive": ("hold=pspm", *_PASSIVE),
}
"""Options of holds, from the simplest on: of equally good ones the first is advised. `a, b`: hold a
from slow to fast, b from fast to slow (`slope`: of the velocity, from slow to fast). A choice, not
the table of holds: these are combinations that the study of the mismatch has measured
(results/mismatch), and `advise` simulates every one."""
REMEDIES = ("zoh", "foh", "lead", "mean")
"""Holds of all connections with which an unstable scene is tried, as a single change."""
GAINS: dict[str, tuple[str, ...]] = {
    name: (f"controller.teleoperation.stiffness={k}", f"controller.teleoperation.damping={b}")
    for name, k, b in (
        ("soft", [25.0, 25.0, 0.01], [5.0, 5.0, 0.002]),
        ("medium", [100.0, 100.0, 0.1], [20.0, 20.0, 0.02]),
        ("stiff", [100.0, 100.0, 0.5], [70.0, 70.0, 0.375]),
    )
}
"""Options of K_pc and B_pc; stiff: those of section B.6; medium: those of the scene
closed-loop-direct."""


def set_rate(clock: str, rate: Fraction) -> str:
    """The option that sets the rate (Hz) of "haptics" or "graphics"."""
    return f"{clock}.rate={write_exact(rate)}"


@dataclass(frozen=True)
class Gain:
    """A parameter of a law, as the scene sets it: the controller's FMU, its key in the scene, the
    power of s by which it is scaled, and its entries."""

    fmu: str
    law: str
    key: str
    power: float
    entries: tuple[tuple[Scalar, float], ...]

    def scaled(self, scales: Scales) -> list[float]:
        return [v * scales.get(self.law, 1.0) ** self.power for _, v in self.entries]


class Gains:
    """The tunable gains of all controllers of a system, and the names of the `laws` that have any.
    apart: the users whose controllers have a table of their own in the scene; the others have
    those of [controller]."""

    def __init__(self, system: System, apart: Collection[str] = ()) -> None:
        self._gains: list[Gain] = []
        self._followers: set[str] = set()
        for fmu in system.fmus:
            if (user := user_of_block(fmu.name, CONTROLLER)) is None:
                continue
            if user and user not in apart:
                self._followers.add(fmu.name)
            table = f"controllers.{user}" if user else CONTROLLER
            for law, (part, *ports) in LAWS.items():
                both = [
                    Gain(fmu.name, law, f"{table}.{part}.{quantity}", power, _entries(fmu, port))
                    for port, (quantity, power) in zip(
                        ports, {"stiffness": 1.0, "damping": 0.5}.items(), strict=True
                    )
                ]
                if all(gain.entries for gain in both):
                    self._gains += both
        self.laws = list(dict.fromkeys(gain.law for gain in self._gains))

    def parameters(self, scales: Scales) -> Iterator[tuple[str, Scalar, float]]:
        """The parameters of the FMUs for the given scales."""
        for gain in self._gains:
            for (scalar, _), value in zip(gain.entries, gain.scaled(scales), strict=True):
                yield gain.fmu, scalar, value

    def applied(self, system: System, scales: Scales) -> System:
        """The system that starts with the given scales."""
        starts: dict[str, list[tuple[Scalar, float]]] = {}
        for name, scalar, value in self.parameters(scales):
            starts.setdefault(name, []).append((scalar, value))
        fmus = (fmu.starting(tuple(starts.get(fmu.name, ()))) for fmu in system.fmus)
        return replace(system, fmus=tuple(fmus))

    def options(self, scales: Scales) -> dict[str, float | list[float]]:
        """The options of a scene with the given scales, to four digits."""
        found: dict[str, float | list[float]] = {}
        for gain in self._gains:
            if gain.fmu in self._followers:
                continue
            values = [float(f"{value:.4g}") for value in gain.scaled(scales)]
            found[gain.key] = values if len(values) > 1 else values[0]
        return found


def _entries(fmu: Fmu, port: str) -> tuple[tuple[Scalar, float], ...]:
    given = fmu.start_values
    return tuple(
        (s, float(given.get(s.name, s.start or 0.0)))
        for s in fmu.description.scalars
        if s.causality == "parameter" and s.port == port and s.variability == "tunable"
    )
