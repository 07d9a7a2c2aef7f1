"""What a page can change of a running scene, with names and ranges, and what its mice pull."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings import labels
from hapticlink.components.specs.linkage import NO_POINT
from hapticlink.orchestrator.base.signal_names import CONTROLLER, HAND, MECHANISM, block_of_user
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.changes import (
    OPERATIONAL_POINT,
    choices_of_slower,
    result_after,
)
from hapticlink.orchestrator.system.springs import find_limited_gains
from hapticlink.orchestrator.system.system import System
from hapticlink.visualization.live_and_standalone.choose_model import (
    MODEL,
    can_have_model,
    has_model,
)
from hapticlink.visualization.live_and_standalone.viewed_scene import mouse

GAINS = (HAND, CONTROLLER)
"""Blocks of a user whose tunable parameters are gains; those of the mechanism are, too."""
OTHERS = ("length_scale", "target", "rank_tolerance", "point")
"""Tunable parameters of theirs that are none."""
TOPOLOGY = ("k_j", "b_j")
"""The gains of the topology controller."""
CLOCK = "graphics"
"""The clock whose rate the page changes."""


RATE, JITTER, RENDERED, SPEED = "graphics.rate", "jitter", "controller.topology", "speed"
"""Keys of the controls of the rate (Hz), of the share of its period by which each may be shorter or
longer, of whether constrained directions are rendered, and of the real-time factor, which all runs
of a page have. Further ones, by connection and parameter: `holds.NAME`, `delays.NAME` (s) and
`gains.NAME`, a factor on the scene's value."""
RANGES = {
    "graphics": (0.01, 1e4), "jitter": (0.0, 0.9), "delays": (0.0, 1.0), "gains": (0.0, 1e2),
    SPEED: (1e-3, 1e3),
}  # fmt: skip
"""Of the values of controls that are numbers, by the first part of their key."""
Settings = dict[str, Any]
"""What was changed on the page, by key, which a run that begins anew gets again."""


class Offered:
    """What can be changed of a scene that runs: `gains`, values and units by parameter; `holds` by
    connection, the present one first; the graphics `rate`, None where there is none."""

    def __init__(
        self,
        scene: Scene,
        system: System,
        holds: Mapping[str, list[str]] | None = None,
        ranges: Mapping[str, tuple[float, float]] = RANGES,
    ) -> None:
        self._linkage = scene.linkage
        self._hardware = any(fmu.hardware for fmu in system.fmus)
        model = has_model(scene)
        self.model = model if model or can_have_model(scene, system) else None
        """Whether the hold `model` is chosen, None where the scene cannot have it."""
        self.gains = _gains(scene, system)
        self.holds = choices_of_slower(system) if holds is None else holds
        fmus = [f for f in system.fmus if f.clock == CLOCK]
        of = dict.fromkeys(labels.block(f.name) or f.name for f in fmus)
        self._of = " and ".join(of)
        self.rate = scene.graphics.rate if scene.graphics and fmus else None
        most = float(1 / (system.timeline.clocks[0].longest * system.timeline.base))
        self._haptics = most
        if late := result_after(system, CLOCK):
            most = min(most, 1 / late)
        self._ranges = {**ranges, "graphics": (ranges["graphics"][0], most)}

    @property
    def own_rate(self) -> float | None:
        """The rate (Hz) of the scene, None where it varies."""
        return float(self.rate) if isinstance(self.rate, int | float) else None

    def described(self, settings: Settings) -> list[dict[str, Any]]:
        """The controls by `key`, each with its value and what bounds it, as JSON has it."""
        controls: list[dict[str, Any]] = []
        if self.rate is not None:
            rate: dict[str, Any] = {"key": RATE, "value": self.own_rate, "words": _title(self._of)}
            rate["haptics"] = self._haptics
            controls += [rate, {"key": JITTER, "value": 0.0}]
        if not self._hardware:
            controls.append({"key": SPEED, "value": 1.0})
        if self.topology:
            controls.append({"key": RENDERED, "value": True})
        if self.model is not None:
            controls.append({"key": MODEL, "value": self.model})
        for name, choices in self.holds.items():
            words = _title(labels.connection(name))
            controls += [
                {"key": f"holds.{name}", "value": choices[0], "words": words, "choices": choices},
                {"key": f"delays.{name}", "value": 0.0, "words": words},
            ]
        for name, (value, units) in self.gains.items():
            start = {"start": value.tolist(), "units": units}
            controls.append({"key": f"gains.{name}", "value": 1.0} | start)
        if self._linkage and self._linkage.choices:
            points = {"key": OPERATIONAL_POINT, "value": self._linkage.held_name}
            choices = [NO_POINT, *self._linkage.choices]
            controls.append(points | {"words": "Point in the hand", "choices": choices})
        for control in controls:
            control["value"] = settings.get(control["key"], control["value"])
            if limits := self._ranges.get(control["key"].partition(".")[0]):
                control["min"], control["max"] = limits
        return controls

    @property
    def topology(self) -> list[str]:
        """The gains of the topology controllers of all users."""
        names = [name for name in self.gains if name.rpartition(".")[2] in TOPOLOGY]
        return names if len(names) >= len(TOPOLOGY) else []


def _title(text: str) -> str:
    return text[:1].upper() + text[1:]


def users(scene: Scene) -> tuple[str, ...]:
    """The users of a scene by their points; the first one's name is empty."""
    return ("", *scene.devices)


def stiffness(user: str) -> str:
    """The stiffness with which a user's mouse pulls."""
    return f"{block_of_user(HAND, user)}.stiffness"


def target(user: str) -> str:
    """The pose that a user's mouse pulls to."""
    return f"{block_of_user(HAND, user)}.target"


def _gains(scene: Scene, system: System) -> dict[str, tuple[NDArray[np.float64], list[str]]]:
    """Values and units of the parameters that a page can scale, by their name."""
    gains: dict[str, tuple[NDArray[np.float64], list[str]]] = {}
    fixed = find_limited_gains(system)
    names = [MECHANISM, *(block_of_user(b, user) for user in users(scene) for b in GAINS)]
    for fmu in (system.fmu[name] for name in names if name in system.fmu):
        tunable = [
            s
            for s in fmu.description.scalars
            if s.causality == "parameter" and s.variability == "tunable" and s.port not in OTHERS
        ]
        given = fmu.start_values
        for port in dict.fromkeys(s.port for s in tunable):
            if f"{fmu.name}.{port}" in fixed:
                continue
            entries = fmu.description.port(port, "parameter")
            start = np.array([given.get(s.name, s.start) for s in entries], float)
            gains[f"{fmu.name}.{port}"] = start, [s.unit or "" for s in entries]
    for name in (stiffness(user) for user in users(scene)):
        if name in gains:
            gains[name] = np.array(mouse(scene.space)[0]), gains[name][1]
    return gains
