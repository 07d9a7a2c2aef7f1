"""The result of a tuning."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from hapticlink.orchestrator.results.again import scene_file
from hapticlink.orchestrator.results.tables import Results
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.tune.held import Complex
from hapticlink.orchestrator.tune.poses import Pose
from hapticlink.orchestrator.tune.search import HANDS

OF = {"scene": "the scene's gains", "tuned": "tuned"}
EQUAL = 0.03
"""Difference of felt stiffnesses, relative, that is equal."""


@dataclass(frozen=True)
class Tuned:
    """run: of the scene with its own gains, without its tables. gains: tables of the scene with the
    tuned ones. scales: of its own gains, by law. margin: g of the tuned gains, not a number before
    it is known, and `own` that of the scene's. limited_by: why larger gains do not hold. felt:
    stiffness (N/m) along the wrenches `along`, "constraint" and "contact", in the pose `felt_at`,
    and `felt_before` that with the scene's own gains; compliance (3, 3) of the handle there, at
    `hertz`. motion: of the runs with the gains of the "scene" and the "tuned" ones, the largest
    "distance" of handle and operational point (m) and "energy_peak", the largest energy generated
    at the user's port (J). neighbours: margins by a rate's key and value."""

    run: Results
    gains: dict[str, dict[str, Any]]
    scales: dict[str, float]
    margin: float
    limited_by: str | None
    own: float
    felt: dict[str, float]
    felt_before: dict[str, float]
    felt_at: str
    along: dict[str, tuple[float, ...]]
    poses: tuple[Pose, ...]
    asked: float
    hertz: float
    compliance: Complex | None
    motion: dict[str, dict[str, float]]
    neighbours: dict[str, float] = field(default_factory=dict)

    @property
    def title(self) -> str:
        return str(self.run.run["scene"]["title"])

    def record(self) -> dict[str, Any]:
        """The content of tune.json."""
        X = self.compliance
        return {
            "title": self.title,
            "gains": self.gains,
            "scales": self.scales,
            "margin_asked": self.asked,
            "margin": None if np.isnan(self.margin) else self.margin,
            "limited_by": self.limited_by,
            "margin_of_scene": self.own,
            "frequency": self.hertz,
            "felt_stiffness": self.felt,
            "felt_stiffness_of_scene": self.felt_before,
            "felt_at": self.felt_at,
            "along": self.along,
            "compliance": None if X is None else np.stack([X.real, X.imag], axis=-1).tolist(),
            "motion": self.motion,
            "margins_at_neighbouring_rates": self.neighbours,
            "poses": [asdict(pose) for pose in self.poses],
            "hands": list(HANDS),
        }

    def scene(self) -> str:
        """The scene with the tuned gains, as a file that stands alone."""
        scene = deepcopy(self.run.run["scene"])
        scene["title"] = f"{self.title}, gains tuned to a margin of {self.asked:g}"
        for key, gains in self.gains.items():
            table = scene
            for name in key.split("."):
                if not isinstance(table[name], Mapping):  # true: all by default
                    table[name] = {}
                table = table[name]
            table.update(gains)
        return scene_file(replace(self.run, run={**self.run.run, "scene": scene}))

    @property
    def finding(self) -> str:
        """What contact and constraint feel like, or the one of them that there is."""
        said = "margin not judged yet" if np.isnan(self.margin) else f"margin {self.margin:.3g}"
        if len(self.felt) == 1:
            ((name, value),) = self.felt.items()
            times = value / self.felt_before[name]
            return f"the {name} feels {times:.2g} times as stiff as with the scene's gains; {said}"
        stiff, soft = sorted(self.felt, key=lambda name: self.felt[name], reverse=True)
        times = self.felt[stiff] / self.felt[soft]
        if times > 1 + EQUAL:
            return f"the {stiff} feels {times:.2g} times as stiff as the {soft}; {said}"
        return f"{stiff} and {soft} both feel like {self.felt[soft]:.3g} N/m; {said}"

    def lines(self) -> Iterator[str]:
        """The result as text."""
        yield self.finding
        yield f"margin {self.margin:.3g}; with the gains of the scene {self.own:.3g}"
        yield f"limited by {self.limited_by}"
        for name, value in self.felt.items():
            yield (
                f"{name} feels like {value:.4g} N/m at {self.hertz:g} Hz; with the gains of the "
                f"scene {self.felt_before[name]:.4g} N/m"
            )
        for gains, run in self.motion.items():
            yield (
                f"along the run, {gains} gains: handle at most "
                f"{1e3 * run['distance']:.3g} mm off, at most {1e3 * run['energy_peak']:.3g} mJ "
                "generated at the user's port"
            )
        for rate, margin in self.neighbours.items():
            yield f"margin at {rate}: {margin:.3g}" + (" (unstable)" if margin < 1.0 else "")
        yield from (f"--set {_quoted(option)}" for option in self.options)

    @property
    def options(self) -> tuple[str, ...]:
        """The gains as options of a scene, `key=value`."""
        return tuple(
            f"{key}.{name}={overrides.text(value, key)}"
            for key, table in self.gains.items()
            for name, value in table.items()
        )


def _quoted(option: str) -> str:
    return f"'{option}'" if "[" in option else option
