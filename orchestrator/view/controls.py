"""What a page can change of a running scene, and how it stands."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.api.real_time import RealTime
from hapticlink.orchestrator.base.faults import InputFault, unknown
from hapticlink.orchestrator.view import messages
from hapticlink.orchestrator.view.scene import STIFFNESS

GAINS = ("hand", "controller", "virtual_mechanism")
"""FMUs whose tunable parameters are gains."""
OTHERS = ("length_scale", "target", "rank_tolerance")
"""Tunable parameters of theirs that are none."""
TOPOLOGY = ("controller.k_j", "controller.b_j")
CLOCK = "graphics"


@dataclass
class Settings:
    """What was changed on the page, which a run that begins anew gets again."""

    rate: float | None = None
    holds: dict[str, str] = field(default_factory=dict)
    delays: dict[str, float] = field(default_factory=dict)
    gains: dict[str, float] = field(default_factory=dict)
    topology: bool = True


class Controls:
    """The controls of a run, with the `settings` of the page."""

    def __init__(self, live: RealTime, settings: Settings) -> None:
        self._live, self._settings = live, settings
        self._gains = _gains(live)
        self._holds = _holds(live)
        fmus = [f for f in live.system.fmus if f.clock == CLOCK]
        self._rate = live.scene.graphics.rate if live.scene.graphics and fmus else None
        self._pulling = False

    def restore(self) -> None:
        """Apply the settings of the page to a run that has just begun."""
        s = self._settings
        if s.rate is not None:
            self._live.rate(CLOCK, s.rate)
        for name in {*s.holds, *s.delays}:
            self._live.hold(name, s.holds.get(name), s.delays.get(name))
        for name in s.gains:
            self._set(name)
        if not s.topology:
            self.apply(messages.Topology("topology", False))

    def described(self) -> dict[str, Any]:
        """The controls with their ranges and values, as JSON has it."""
        s, fixed = self._settings, isinstance(self._rate, int | float)
        haptics = self._live.system.timeline
        most = float(1 / (haptics.clocks[0].longest * haptics.base))
        return {
            "rate": None
            if self._rate is None
            else {"value": s.rate or (float(self._rate) if fixed else None), "max": most},  # type: ignore[arg-type]
            "holds": [
                {"connection": name, "hold": s.holds.get(name, choices[0]), "choices": choices}
                | {"delay": s.delays.get(name, 0.0)}
                for name, choices in self._holds.items()
            ],
            "gains": [
                {"name": name, "value": value.tolist(), "units": units}
                | {"factor": s.gains.get(name, 1.0)}
                for name, (value, units) in self._gains.items()
            ],
            "topology": s.topology if all(name in self._gains for name in TOPOLOGY) else None,
        }

    def apply(self, message: messages.Message) -> None:
        """Change the run. Raises InputFault where the message does not fit this scene; nothing is
        changed then."""
        match message:
            case messages.Hand(at=at):
                self._pull(at)
            case messages.Rate(value=value):
                self._live.rate(CLOCK, value)
                self._settings.rate = value
            case messages.Hold(connection=name, hold=hold):
                self._require(name, self._holds)
                self._live.hold(name, hold)
                self._settings.holds[name] = hold
            case messages.Delay(connection=name, value=value):
                self._require(name, self._holds)
                self._live.hold(name, None, value)
                self._settings.delays[name] = value
            case messages.Gain(name=name, factor=factor):
                self._require(name, self._gains)
                self._settings.gains[name] = factor
                self._set(name)
            case messages.Topology(on=on):
                for name in TOPOLOGY:
                    self._require(name, self._gains)
                self._settings.topology = on
                for name in TOPOLOGY:
                    self._set(name)

    def fits(self, message: messages.Hold) -> bool:
        """Whether the connection can have the hold, in a run that begins with it at least."""
        return message.hold in self._holds.get(message.connection, ())

    def _require(self, name: str, known: dict[str, Any]) -> None:
        if name not in known:
            raise InputFault(unknown("control", name, known))

    def _set(self, name: str) -> None:
        """Set a parameter to its multiple; the hand's stiffness acts while it pulls."""
        value, _ = self._gains[name]
        factor = self._settings.gains.get(name, 1.0)
        if name in TOPOLOGY and not self._settings.topology:
            factor = 0.0
        if name != "hand.stiffness" or self._pulling:
            self._live.set(name, factor * value)

    def _pull(self, at: tuple[float, float] | None) -> None:
        pulling = at is not None
        if at is not None:
            self._live.set("hand.target", (*at, 0.0))
        if pulling != self._pulling:
            self._pulling = pulling
            if pulling:
                self._set("hand.stiffness")
            else:
                self._live.set("hand.stiffness", (0.0, 0.0, 0.0))


def _gains(live: RealTime) -> dict[str, tuple[NDArray[np.float64], list[str]]]:
    """Values and units of the parameters that a page can scale, by their name."""
    found: dict[str, tuple[NDArray[np.float64], list[str]]] = {}
    for fmu in (f for f in live.system.fmus if f.name in GAINS):
        tunable = [
            s
            for s in fmu.description.scalars
            if s.causality == "parameter" and s.variability == "tunable" and s.port not in OTHERS
        ]
        for port in dict.fromkeys(s.port for s in tunable):
            entries = fmu.description.port(port, "parameter")
            start = np.array([s.start for s in entries])
            found[f"{fmu.name}.{port}"] = start, [s.unit or "" for s in entries]
    if "hand.stiffness" in found:
        found["hand.stiffness"] = np.array(STIFFNESS), found["hand.stiffness"][1]
    return found


def _holds(live: RealTime) -> dict[str, list[str]]:
    """The connections from a slower clock to the haptic one, with the holds that they can have."""
    fast = live.system.timeline.clocks[0].name
    return {
        name: choices
        for name, choices in live.holds().items()
        if live.system.fmu[live.system.connection[name].source].clock != fast
    }
