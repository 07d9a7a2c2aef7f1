"""The controls of a run behind the server: the messages of a page, applied to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.errors import InputFault, unknown
from hapticlink.orchestrator.real_time_session import LiveRun
from hapticlink.orchestrator.system.live_changes import choices_between_rates
from hapticlink.visualization.interactive_scene.offered_controls import (
    CLOCK,
    Offered,
    Settings,
    stiffness,
    target,
    users,
)
from hapticlink.visualization.live_page import messages


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
        """Change the rate, that of the scene where it is None, with the jitter. At the scene's
        rate without jitter steps end where the scene has it."""
        own = self._rate if isinstance(self._rate, int | float) else None
        rate = None if rate == own else rate
        if jitter and rate is own is None:
            raise InputFault("the rate varies in this scene: set the rate first")
        self._live.rate(CLOCK, own if rate is None and jitter else rate, jitter)
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
