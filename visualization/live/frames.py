"""What a page is sent of a running scene: outputs of its FMUs, energies and deadlines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hapticlink.analysis.findings import words
from hapticlink.orchestrator.base.loop_names import (
    CONTROLLER,
    DEVICE,
    HAND,
    MECHANISM_ENERGY,
)
from hapticlink.orchestrator.real_time_session import LiveRun
from hapticlink.orchestrator.system.system import Connection, System
from hapticlink.visualization.frame_signals import shown, shown_of_user

SELDOM = 5
"""Turns between two readings of energies and deadlines, which take longer."""


class Frames:
    """The frames of one run, a few numbers each."""

    def __init__(self, live: LiveRun) -> None:
        fmus = live.system.fmu
        self._outputs = there(fmus, shown())
        self._others = {user: there(fmus, shown_of_user(user)) for user in live.scene.devices}
        self._turns = 0

    def handles(self, live: LiveRun) -> dict[str, list[float]]:
        """The poses (3,) of the handles by user, "" for the first one."""
        every = {"": self._outputs, **self._others}
        return {user: live[outputs["handle"]].tolist() for user, outputs in every.items()}

    def frame(self, live: LiveRun) -> dict[str, Any]:
        """The newest samples, and now and then what the meters have `booked`, the work (J) of the
        held and of the ideal effort by connection, with the energy `stored` in the mechanism, and
        the deadlines `missed`."""
        found: dict[str, Any] = {k: live[name].tolist() for k, name in self._outputs.items()}
        if self._turns % SELDOM == 0:
            found["booked"] = [[e.held, e.ideal] for e in live.energies().values()]
            found["stored"] = float(live[MECHANISM_ENERGY][0])
        elif self._turns % SELDOM == 2:
            found["missed"] = live.report()["deadlines_missed"]
        self._turns += 1
        if self._others:
            found["others"] = {
                user: {k: live[name].tolist() for k, name in outputs.items()}
                for user, outputs in self._others.items()
            }
        return {"t": live.time} | found


def power(system: System, connections: Iterable[str]) -> list[dict[str, Any]]:
    """Of each connection that carries power, its `words`, whether a `hand` does work there on its
    handle or on a further point, and whether what is put in there `counts`: what a controller
    passes on was not put in by it."""
    on = [system.connection[name] for name in connections]
    handles = {c.source for c in on if system.block(c.target) == DEVICE}

    def hand(c: Connection) -> bool:
        if system.block(c.source) != HAND:
            return False
        return system.block(c.target) == DEVICE or c.source not in handles

    return [
        {
            "name": c.name,
            "words": words.connection(c.name),
            "hand": hand(c),
            "counts": system.block(c.source) != CONTROLLER,
        }
        for c in on
    ]


def there(fmus: Any, asked: Mapping[str, tuple[str, ...]]) -> dict[str, str]:
    """The first of the outputs that the scene has, by name in a frame."""
    found = {k: [name for name in names if _has(fmus, name)] for k, names in asked.items()}
    return {k: names[0] for k, names in found.items() if names}


def _has(fmus: Any, name: str) -> bool:
    fmu, _, port = name.partition(".")
    return fmu in fmus and bool(fmus[fmu].description.port(port, "output"))
