"""The controls of a run behind the server: the messages of a page, applied to it."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.errors import InputFault, unknown
from hapticlink.orchestrator.real_time_session import LiveRun
from hapticlink.orchestrator.scene.blocks import driver_of
from hapticlink.orchestrator.system.changes import OPERATIONAL_POINT, choices_between_rates
from hapticlink.visualization.live_and_standalone.offered_controls import (
    CLOCK,
    JITTER,
    MODEL,
    RATE,
    RENDERED,
    SPEED,
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
        self._gains = self._offered.gains
        self._known = [control["key"] for control in self.described()]
        self._pulling = {user: False for user in users(live.scene)}

    def restore(self) -> list[str]:
        """Apply the settings of the page to a run that has just begun, and forget those that it
        cannot have; why, of each."""
        refused = {k: "there is no such control" for k in self._settings if k not in self._known}
        for key in dict.fromkeys(_together(key) for key in self._settings if key in self._known):
            try:
                self._act(key)
            except InputFault as fault:
                refused |= {k: str(fault) for k in self._settings if _together(k) == key}
        for key in refused:
            del self._settings[key]
        return [f"{key} is as in the scene: {why}" for key, why in refused.items()]

    def described(self) -> list[dict[str, Any]]:
        """The controls, as JSON has them."""
        return self._offered.described(self._settings)

    def apply(self, message: messages.Hand | messages.SetControl) -> None:
        """Change the run. Raises InputFault where the message does not fit this scene; nothing is
        changed then."""
        if isinstance(message, messages.Hand):
            return self._pull(message.user, message.at)
        _require(message.key, self._known)
        before = dict(self._settings)
        self._settings[message.key] = message.value
        try:
            self._act(_together(message.key))
        except InputFault:
            self._settings.clear()
            self._settings |= before
            raise

    def _act(self, key: str) -> None:
        """Carry out what is set of a control."""
        kind, _, name = key.partition(".")
        if key == MODEL:
            return  # a run begins with it
        if key == RATE:
            self._change_rate()
        elif key == SPEED:
            self._live.speed = self._settings[key]
        elif key == OPERATIONAL_POINT:
            self._live.set(key, self._settings[key])
        elif kind == "holds":
            held: Any = (self._settings.get(f"{each}.{name}") for each in ("holds", "delays"))
            self._live.hold(name, *held)
        else:
            for gain in self._offered.topology if key == RENDERED else [name]:
                self._set(gain)

    def begins_with(self, message: messages.SetControl) -> bool:
        """Whether it sets a hold that the connection can have in a run that begins with it."""
        return message.value in self._offered.holds.get(message.key.removeprefix("holds."), ())

    @property
    def pulled(self) -> bool:
        """Whether a hand pulls the first user's handle, as the one that holds a board does."""
        return self._pulling[""] or bool(driver_of(self._live.scene, ""))

    def parameters(self) -> dict[str, list[float]]:
        """The gains as they are set, with all hands pulling."""
        return {name: self._value(name).tolist() for name in self._gains}

    def _value(self, name: str) -> NDArray[np.float64]:
        """The multiple of a parameter that is set."""
        off = name in self._offered.topology and not self._settings.get(RENDERED, True)
        return self._gains[name][0] * (0.0 if off else self._settings.get(f"gains.{name}", 1.0))

    def _set(self, name: str) -> None:
        """Set a parameter to its multiple; the hand's stiffness acts while it pulls."""
        springs = {stiffness(user): pulling for user, pulling in self._pulling.items()}
        if springs.get(name, True):
            self._live.set(name, self._value(name))

    def _change_rate(self) -> None:
        """Change rate and jitter. At the scene's rate without jitter steps end where the scene has
        it."""
        settings, own = self._settings, self._offered.own_rate
        if settings.get(RATE) == own:
            settings.pop(RATE, None)
        rate, jitter = settings.get(RATE), settings.get(JITTER, 0.0)
        if jitter and rate is own is None:
            raise InputFault("the rate varies in this scene: set the rate first")
        self._live.rate(CLOCK, own if rate is None and jitter else rate, jitter)

    def _pull(self, user: str, at: tuple[float, ...] | None) -> None:
        _require(user, self._pulling)
        linkage = self._live.scene.linkage
        if at is not None and linkage and len(at) != linkage.dimension:
            raise InputFault(f"at: this hand is pulled to a place of {linkage.dimension} numbers")
        if driver_of(self._live.scene, user):  # which somebody's own hand moves
            return
        if at is not None:
            self._live.set(target(user), (*at, 0.0)[:3])  # in the plane with its angle
        pulling = at is not None
        if pulling != self._pulling[user]:
            self._pulling[user] = pulling
            if pulling:
                self._set(stiffness(user))
            else:
                self._live.set(stiffness(user), (0.0, 0.0, 0.0))


def _together(key: str) -> str:
    """The key of what is set at once: a rate with its jitter, a hold with its delay."""
    return RATE if key == JITTER else key.replace("delays.", "holds.", 1)


def _require(name: str, known: Collection[str]) -> None:
    if name not in known:
        raise InputFault(unknown("control", name, known))
