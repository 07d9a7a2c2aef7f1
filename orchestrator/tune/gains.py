"""The gains that are tuned: stiffness and damping of each law, scaled with one damping ratio.

A law with stiffness K and damping B is scaled by s to s K and sqrt(s) B, which keeps its damping
ratio B/(2 sqrt(K m)) on any mass.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.system.system import System


@dataclass(frozen=True)
class Law:
    """A law by name: the FMU, its parameters of stiffness and damping, and the table of a scene
    that has them as `stiffness` and `damping`."""

    name: str
    fmu: str
    stiffness: str
    damping: str
    table: str


LAWS = (
    Law("drift", "controller", "K_pc", "B_pc", "controller.teleoperation"),
    Law("topology", "controller", "k_j", "b_j", "controller.topology"),
    Law("graphics", "virtual_environment", "K_g", "B_g", "graphics"),
)
Scales = Mapping[str, float]
"""The scale s of each law, by name; 1 where it is missing."""


@dataclass(frozen=True)
class Gains:
    """The laws that a system has, and their gains as the scene sets them."""

    laws: tuple[Law, ...]
    starts: dict[tuple[str, str], list[tuple[Scalar, float]]]

    @classmethod
    def of(cls, system: System) -> Gains:
        """Those of the FMUs' tunable parameters."""
        starts: dict[tuple[str, str], list[tuple[Scalar, float]]] = {}
        laws = []
        for law in LAWS:
            if law.fmu not in system.fmu:
                continue
            fmu = system.fmu[law.fmu]
            given = {scalar.name: value for scalar, value in fmu.starts}
            for port in (law.stiffness, law.damping):
                starts[law.name, port] = [
                    (s, float(given.get(s.name, s.start or 0.0)))
                    for s in fmu.description.scalars
                    if s.causality == "parameter" and s.port == port and s.variability == "tunable"
                ]
            if starts[law.name, law.stiffness] and starts[law.name, law.damping]:
                laws.append(law)
        return cls(tuple(laws), starts)

    def values(self, law: Law, scale: float) -> tuple[list[float], list[float]]:
        """Stiffness and damping of a law, entry by entry, scaled."""
        stiffness, damping = (self.starts[law.name, p] for p in (law.stiffness, law.damping))
        return [v * scale for _, v in stiffness], [v * math.sqrt(scale) for _, v in damping]

    def parameters(self, scales: Scales) -> Iterator[tuple[str, Scalar, float]]:
        """The parameters of the FMUs for the given scales."""
        for law in self.laws:
            both = self.values(law, scales.get(law.name, 1.0))
            for port, values in zip((law.stiffness, law.damping), both, strict=True):
                for (scalar, _), value in zip(self.starts[law.name, port], values, strict=True):
                    yield law.fmu, scalar, value

    def tables(self, scales: Scales) -> dict[str, dict[str, float | list[float]]]:
        """The tables of a scene with the given scales, by dotted key, to four digits."""

        def written(values: list[float]) -> float | list[float]:
            rounded = [float(f"{value:.4g}") for value in values]
            return rounded if len(rounded) > 1 else rounded[0]

        found = {}
        for law in self.laws:
            stiffness, damping = self.values(law, scales.get(law.name, 1.0))
            found[law.table] = {"stiffness": written(stiffness), "damping": written(damping)}
        return found
