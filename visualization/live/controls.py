"""What a page can change of a running scene, and how it stands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings import words
from hapticlink.orchestrator.base.faults import InputFault, unknown
from hapticlink.orchestrator.base.loop_names import CONTROLLER, HAND, MECHANISM, block_of_user
from hapticlink.orchestrator.real_time_session import LiveRun
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.live_changes import choices_between_rates, choices_of_slower
from hapticlink.orchestrator.system.springs import limited_gains
from hapticlink.orchestrator.system.system import System
from hapticlink.visualization.live import messages
from hapticlink.visualization.live.viewed_scene import STIFFNESS

GAINS = (HAND, CONTROLLER)
"""Blocks of a user whose tunable parameters are gains; those of the mechanism are, too."""
OTHERS = ("length_scale", "target", "rank_tolerance")
"""Tunable parameters of theirs that are none."""
TOPOLOGY = ("k_j", "b_j")
"""The gains of the topology controller."""
CLOCK = "graphics"


@dataclass
class Settings:
    """What was changed on the page, which a run that begins anew gets again."""

    rate: float | None = None
    jitter: float = 0.0
    holds: dict[str, str] = field(default_factory=dict)
    delays: dict[str, float] = field(default_factory=dict)
    gains: dict[str, float] = field(default_factory=dict)
    topology: bool = True


class Offered:
    """What can be changed of a scene that runs: `gains`, values and units by parameter; `holds` by
    connection, the present one first; the graphics `rate`, None where there is none."""

    def __init__(
        self, scene: Scene, system: System, holds: Mapping[str, list[str]] | None = None
    ) -> None:
        self.gains = _gains(scene, system)
        self.holds = choices_of_slower(system) if holds is None else holds
        fmus = [f for f in system.fmus if f.clock == CLOCK]
        of = dict.fromkeys(words.block(f.name) or f.name for f in fmus)
        self._of = " and ".join(of)
        self.rate = scene.graphics.rate if scene.graphics and fmus else None
        haptics = system.timeline
        self._most = float(1 / (haptics.clocks[0].longest * haptics.base))

    def described(self, s: Settings) -> dict[str, Any]:
        """The controls with their ranges and values, as JSON has it."""
        fixed = float(self.rate) if isinstance(self.rate, int | float) else None
        return {
            "rate": None
            if self.rate is None
            else {"value": s.rate or fixed, "max": self._most, "jitter": s.jitter}
            | {"of": _titled(self._of)},
            "holds": [
                {"connection": name, "words": _titled(words.connection(name))}
                | {"hold": s.holds.get(name, choices[0]), "choices": choices}
                | {"delay": s.delays.get(name, 0.0)}
                for name, choices in self.holds.items()
            ],
            "gains": [
                {"name": name, "value": value.tolist(), "units": units}
                | {"factor": s.gains.get(name, 1.0)}
                for name, (value, units) in self.gains.items()
            ],
            "topology": s.topology if self.topology else None,
        }

    @property
    def topology(self) -> list[str]:
        """The gains of the topology controllers of all users."""
        found = [name for name in self.gains if name.rpartition(".")[2] in TOPOLOGY]
        return found if len(found) >= len(TOPOLOGY) else []


class Controls:
    """The controls of a run, with the `settings` of the page."""

    def __init__(self, live: LiveRun, settings: Settings) -> None:
        self._live, self._settings = live, settings
        self._offered = Offered(live.scene, live.system, choices_between_rates(live.system))
        self._gains, self._holds = self._offered.gains, self._offered.holds
        self._rate, self._topology = self._offered.rate, self._offered.topology
        self._pulling = {user: False for user in users(live.scene)}

    def restore(self) -> None:
        """Apply the settings of the page to a run that has just begun."""
        s = self._settings
        if s.rate is not None or s.jitter:
            self._change_rate(s.rate, s.jitter)
        for name in {*s.holds, *s.delays}:
            self._live.hold(name, s.holds.get(name), s.delays.get(name))
        for name in s.gains.keys() & self._gains.keys():
            self._set(name)
        if not s.topology:
            self.apply(messages.Topology("topology", False))

    def described(self) -> dict[str, Any]:
        """The controls with their ranges and values, as JSON has it."""
        return self._offered.described(self._settings)

    def apply(self, message: messages.Message) -> None:
        """Change the run. Raises InputFault where the message does not fit this scene; nothing is
        changed then."""
        match message:
            case messages.Hand(at=at, user=user):
                self._pull(user, at)
            case messages.Rate(value=value):
                self._change_rate(value, self._settings.jitter)
            case messages.Jitter(value=value):
                self._change_rate(self._settings.rate, value)
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
                if not self._topology:
                    raise InputFault("this scene has no topology controller")
                self._settings.topology = on
                for name in self._topology:
                    self._set(name)

    def fits(self, message: messages.Hold) -> bool:
        """Whether the connection can have the hold, in a run that begins with it at least."""
        return message.hold in self._holds.get(message.connection, ())

    def _require(self, name: str, known: Mapping[str, Any]) -> None:
        if name not in known:
            raise InputFault(unknown("control", name, known))

    def parameters(self) -> dict[str, list[float]]:
        """The gains as they are set, with all hands pulling."""
        return {name: self._value(name).tolist() for name in self._gains}

    def _value(self, name: str) -> NDArray[np.float64]:
        """The multiple of a parameter that is set."""
        off = name in self._topology and not self._settings.topology
        return self._gains[name][0] * (0.0 if off else self._settings.gains.get(name, 1.0))

    def _set(self, name: str) -> None:
        """Set a parameter to its multiple; the hand's stiffness acts while it pulls."""
        springs = {stiffness(user): pulling for user, pulling in self._pulling.items()}
        if springs.get(name, True):
            self._live.set(name, self._value(name))

    def _change_rate(self, rate: float | None, jitter: float) -> None:
        """Change the rate, that of the scene where it is None, with the jitter."""
        if rate is None and not isinstance(self._rate, int | float):
            raise InputFault("the rate varies in this scene: set the rate first")
        self._live.rate(CLOCK, self._rate if rate is None else rate, jitter)  # type: ignore[arg-type]
        self._settings.rate, self._settings.jitter = rate, jitter

    def _pull(self, user: str, at: tuple[float, float] | None) -> None:
        self._require(user, self._pulling)
        if at is not None:
            self._live.set(target(user), (*at, 0.0))
        pulling = at is not None
        if pulling != self._pulling[user]:
            self._pulling[user] = pulling
            if pulling:
                self._set(stiffness(user))
            else:
                self._live.set(stiffness(user), (0.0, 0.0, 0.0))


def _titled(text: str) -> str:
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
    found: dict[str, tuple[NDArray[np.float64], list[str]]] = {}
    fixed = limited_gains(system)
    names = [MECHANISM, *(block_of_user(b, user) for user in users(scene) for b in GAINS)]
    for fmu in (system.fmu[name] for name in names if name in system.fmu):
        tunable = [
            s
            for s in fmu.description.scalars
            if s.causality == "parameter" and s.variability == "tunable" and s.port not in OTHERS
        ]
        for port in dict.fromkeys(s.port for s in tunable):
            if f"{fmu.name}.{port}" in fixed:
                continue
            entries = fmu.description.port(port, "parameter")
            start = np.array([s.start for s in entries])
            found[f"{fmu.name}.{port}"] = start, [s.unit or "" for s in entries]
    for name in (stiffness(user) for user in users(scene)):
        if name in found:
            found[name] = np.array(STIFFNESS), found[name][1]
    return found
