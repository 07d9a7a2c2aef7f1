"""The result of a tuning."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from hapticlink.analysis.stability.hands import SPRINGS
from hapticlink.analysis.stability.poses import Pose
from hapticlink.analysis.tune.felt_stiffness import HERTZ
from hapticlink.orchestrator.base.arrays import Complex, Vector
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.recorded_scene import scene_file
from hapticlink.orchestrator.scene import overrides

EQUAL = 0.03
"""Difference of felt stiffnesses, relative, that is equal."""


@dataclass
class Tuned:
    """The result of a tuning. Margins, felt stiffnesses and motion are those of the "scene" and of
    the "tuned" gains."""

    run: Results
    """The run of the scene with its own gains, without its tables."""
    asked: float
    """The margin that was asked for."""
    poses: Sequence[Pose]
    """Where gains were judged."""
    felt_at: str
    """The name of the pose in which stiffness is felt."""
    along: Mapping[str, Vector]
    """The unit wrenches along which it is felt: "constraint", "contact"."""
    margins: dict[str, float]
    """Also at neighbouring rates, once judged."""
    felt: dict[str, dict[str, float]]
    """Stiffness (N/m) along each wrench."""
    motion: dict[str, dict[str, float]]
    """Along the run: the largest "distance" of handle and operational point (m), and "energy_peak",
    the largest energy generated at the user's port (J)."""
    own_run_breaks: str = ""
    """Which limit the scene's own run breaks, so that others are not judged relative to it."""
    gains: dict[str, float | list[float]] = field(default_factory=dict)
    """The tuned ones, as options of the scene."""
    compliance: Complex | None = None
    """Of the handle (3, 3) with the tuned gains."""
    limited_by: str | None = None
    """Why larger gains do not hold."""

    @property
    def title(self) -> str:
        return str(self.run.record.scene["title"])

    def record(self) -> dict[str, Any]:
        """The content of tune.json."""
        X = self.compliance
        return {
            "title": self.title,
            "gains": self.gains,
            "margin_asked": self.asked,
            "margins": self.margins,
            "limited_by": self.limited_by,
            "frequency": HERTZ,
            "felt_stiffness": self.felt,
            "felt_at": self.felt_at,
            "along": {name: n.tolist() for name, n in self.along.items()},
            "compliance": None if X is None else np.stack([X.real, X.imag], axis=-1).tolist(),
            "motion": self.motion,
            "own_run_breaks": self.own_run_breaks or None,
            "poses": [asdict(pose) for pose in self.poses],
            "hands": list(SPRINGS),
        }

    def scene(self) -> str:
        """The scene with the tuned gains, as a file that stands alone."""
        scene = deepcopy(self.run.record.scene)
        scene["title"] = f"{self.title}, gains tuned to a margin of {self.asked:g}"
        for key, value in self.gains.items():
            *names, last = key.split(".")
            table = scene
            for name in names:
                if not isinstance(table[name], Mapping):  # true: all by default
                    table[name] = {}
                table = table[name]
            table[last] = value
        return scene_file(replace(self.run, run={**self.run.run, "scene": scene}))

    @property
    def finding(self) -> str:
        """What contact and constraint feel like, or the one of them that there is."""
        judged = self.margins.get("tuned")
        said = "margin not judged yet" if judged is None else f"margin {judged:.3g}"
        before, felt = self.felt["scene"], self.felt["tuned"]
        if len(felt) == 1:
            ((name, value),) = felt.items()
            times = value / before[name]
            return f"the {name} feels {times:.2g} times as stiff as with the scene's gains; {said}"
        stiff, soft = sorted(felt, key=lambda name: felt[name], reverse=True)
        times = felt[stiff] / felt[soft]
        if times > 1 + EQUAL:
            return f"the {stiff} feels {times:.2g} times as stiff as the {soft}; {said}"
        return f"{stiff} and {soft} both feel like {felt[soft]:.3g} N/m; {said}"

    def lines(self) -> Iterator[str]:
        """The result as text."""
        yield self.finding
        yield f"limited by {self.limited_by}"
        if self.own_run_breaks:
            yield f"the scene's own run is no measure, for it breaks a limit: {self.own_run_breaks}"
        for at, margin in self.margins.items():
            yield f"margin, {at}: {margin:.3g}" + (" (unstable)" if margin < 1.0 else "")
        for gains, felt in self.felt.items():
            for name, value in felt.items():
                yield f"{gains} gains: {name} feels like {value:.4g} N/m at {HERTZ:g} Hz"
        for gains, run in self.motion.items():
            said = f"handle at most {1e3 * run['distance']:.3g} mm off"
            if not np.isfinite(run["distance"]):
                said = "it fails, or generates more energy than is put in"
            if np.isfinite(run["energy_peak"]):
                said += f", at most {1e3 * run['energy_peak']:.3g} mJ generated at the user's port"
            yield f"{gains} gains: along the run, {said}"
        yield from map(overrides.as_command_line, overrides.write_options(self.gains))
