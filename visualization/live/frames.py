"""What a page is sent of a running scene: outputs of its FMUs, energies and deadlines."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from hapticlink.analysis.findings.limits import NOTICEABLE_J
from hapticlink.orchestrator.base.loop_names import (
    DEVICE,
    HAND,
    MECHANISM_ENERGY,
)
from hapticlink.orchestrator.real_time_session import LiveRun
from hapticlink.orchestrator.results.run_record import Energy
from hapticlink.orchestrator.run.energy.balance import generated_and_put_in
from hapticlink.visualization.frame_signals import shown, shown_of_user
from hapticlink.visualization.mechanism.picture import PORT

SELDOM = 5
"""Turns between two readings of energies and deadlines, which take longer."""
WINDOW = 1.0
"""Time (s) over which the light judges the energy."""


class Frames:
    """The frames of one run, a few numbers each."""

    def __init__(self, live: LiveRun) -> None:
        fmus = live.system.fmu
        self._outputs = _there(fmus, shown())
        self._others = {user: _there(fmus, shown_of_user(user)) for user in live.scene.devices}
        self._turns, self._start = 0, float(live[MECHANISM_ENERGY][0])
        self._past: deque[tuple[float, float, float]] = deque()
        self._energy: dict[str, float] = {}

    def handles(self, live: LiveRun) -> dict[str, list[float]]:
        """The poses (3,) of the handles by user, "" for the first one."""
        every = {"": self._outputs, **self._others}
        return {user: live[outputs["handle"]].tolist() for user, outputs in every.items()}

    def frame(self, live: LiveRun) -> dict[str, Any]:
        """The newest samples, `energy` (generated, J, at the user's port and by connection), and
        now and then `light` and the deadlines `missed`."""
        found: dict[str, Any] = {k: live[name].tolist() for k, name in self._outputs.items()}
        if self._turns % SELDOM == 0:
            self._energy, found["light"] = self._energies(live)
        elif self._turns % SELDOM == 2:
            found["missed"] = live.report()["deadlines_missed"]
        self._turns += 1
        if self._others:
            found["others"] = {
                user: {k: live[name].tolist() for k, name in outputs.items()}
                for user, outputs in self._others.items()
            }
        return {"t": live.time, "energy": self._energy} | found

    def _energies(self, live: LiveRun) -> tuple[dict[str, float], str]:
        booked = live.energies()
        generated, put_in = generated_and_put_in(live.system, booked)
        self._past.append((live.time, generated, put_in))
        while live.time - self._past[0][0] > WINDOW:
            self._past.popleft()
        _, before, put_before = self._past[0]
        energy = {name: e.generated for name, e in booked.items()}
        said = light(generated - before, put_in - put_before)
        return {PORT: self._port(live, booked)} | energy, said

    def _port(self, live: LiveRun, booked: Mapping[str, Energy]) -> float:
        """The energy generated at the user's port, as results/user_port has it: what the mechanism
        has stored beyond the work of the hands on their handles and on further points."""
        block = live.system.block
        on = [live.system.connection[n] for n in booked]
        handles = {c.source for c in on if block(c.target) == DEVICE}
        hands = [
            c.name
            for c in on
            if block(c.source) == HAND and (block(c.target) == DEVICE or c.source not in handles)
        ]
        stored = float(live[MECHANISM_ENERGY][0]) - self._start
        return stored - sum(booked[name].held for name in hands)


def light(generated: float, put_in: float) -> str:
    """What the energies (J) of the last second say: red where sampling and holding generated more
    than hands and mechanism put in, as in the judgement of a whole run, by more than
    `NOTICEABLE_J`; amber from a tenth of that on; green otherwise."""
    most = max(put_in, 0.0) + NOTICEABLE_J
    return "red" if generated > most else "amber" if generated > 0.1 * most else "green"


def _there(fmus: Any, asked: Mapping[str, tuple[str, ...]]) -> dict[str, str]:
    """The first of the outputs that the scene has, by name in a frame."""
    found = {k: [name for name in names if _has(fmus, name)] for k, names in asked.items()}
    return {k: names[0] for k, names in found.items() if names}


def _has(fmus: Any, name: str) -> bool:
    fmu, _, port = name.partition(".")
    return fmu in fmus and bool(fmus[fmu].description.port(port, "output"))
