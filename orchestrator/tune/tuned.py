"""The result of a tuning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.tune.held import Complex
from hapticlink.orchestrator.tune.poses import Pose
from hapticlink.orchestrator.tune.search import EQUAL, FINE, HANDS


@dataclass(frozen=True)
class Tuned:
    """given: the options of the scene that was tuned. tables: its tables with the gains. scales: of
    its own gains, by law. margin: g of the tuned gains, and `own` that of the scene's. felt:
    stiffness (N/m) by "constraint" and "contact", and `felt_before` that with the scene's own
    gains. neighbours: margins by a rate's key and value. limits: of each law alone. compliances:
    (3, 3) of the handle in each pose, at `hertz`, in a firm grip."""

    title: str
    given: tuple[str, ...]
    tables: dict[str, dict[str, Any]]
    scales: dict[str, float]
    margin: float
    own: float
    felt: dict[str, float]
    felt_before: dict[str, float]
    poses: tuple[Pose, ...]
    limits: dict[str, float]
    asked: float
    hertz: float
    compliances: dict[str, Complex]
    neighbours: dict[str, float] = field(default_factory=dict)

    def record(self) -> dict[str, Any]:
        """The content of tune.json."""
        return {
            "title": self.title,
            "options": list(self.given),
            "gains": self.tables,
            "scales": self.scales,
            "limits_alone": self.limits,
            "margin_asked": self.asked,
            "margin": self.margin,
            "margin_of_scene": self.own,
            "frequency": self.hertz,
            "felt_stiffness": self.felt,
            "felt_stiffness_of_scene": self.felt_before,
            "compliance": {
                name: np.stack([X.real, X.imag], axis=-1).tolist()
                for name, X in self.compliances.items()
            },
            "margins_at_neighbouring_rates": self.neighbours,
            "poses": [asdict(pose) for pose in self.poses],
            "hands": list(HANDS),
        }

    @property
    def finding(self) -> str:
        """What contact and constraint feel like, or the one of them that there is."""
        said = f"at a margin of {self.margin:.3g}"
        if len(self.felt) == 1:
            ((name, value),) = self.felt.items()
            if not np.isfinite(value):
                return f"the {name} feels rigid whatever the gains, {said}"
            times = value / self.felt_before[name]
            return f"the {name} feels {times:.2g} times as stiff as with the scene's gains, {said}"
        stiff, soft = sorted(self.felt, key=lambda name: self.felt[name], reverse=True)
        if not np.isfinite(self.felt[stiff]):
            return f"the {stiff} feels rigid whatever its gain, {said}"
        times = self.felt[stiff] / self.felt[soft]
        if times > 1 + EQUAL + FINE:
            return f"the {stiff} feels {times:.2g} times as stiff as the {soft}, {said}"
        return f"{stiff} and {soft} feel alike to {100 * (times - 1):.1f} %, {said}"

    def lines(self) -> Iterator[str]:
        """The result as text."""
        yield self.finding
        yield f"margin {self.margin:.3g}; with the gains of the scene {self.own:.3g}"
        for name, value in self.felt.items():
            yield (
                f"{name} feels like {_stiffness(value)} at {self.hertz:g} Hz; with the gains of "
                f"the scene {_stiffness(self.felt_before[name])}"
            )
        for rate, margin in self.neighbours.items():
            yield f"margin at {rate}: {margin:.3g}" + (" (unstable)" if margin < 1.0 else "")
        yield from (f"--set {_quoted(option)}" for option in self.options)

    @property
    def options(self) -> tuple[str, ...]:
        """The gains as options of a scene, `key=value`."""
        return tuple(
            f"{key}.{name}={overrides.text(value, key)}"
            for key, table in self.tables.items()
            for name, value in table.items()
        )


def _stiffness(value: float) -> str:
    return f"{value:.4g} N/m" if np.isfinite(value) else "a rigid body"


def _quoted(option: str) -> str:
    return f"'{option}'" if "[" in option else option
