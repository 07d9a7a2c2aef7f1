"""What a page is sent of a running scene: outputs of its FMUs, energies and deadlines."""

from __future__ import annotations

import time
from typing import Any

from hapticlink.orchestrator.base.signal_names import MECHANISM_ENERGY
from hapticlink.orchestrator.real_time_session import LiveRun
from hapticlink.visualization.live_page.server_pipe import Pipe
from hapticlink.visualization.mechanism.frame_signals import outputs

FRAME = 0.015
"""Time (s) between two frames, at least."""
SELDOM = 5
"""Turns between two readings of energies and deadlines, which take longer."""


class FrameReader:
    """The frames of one run, a few numbers each."""

    def __init__(self, live: LiveRun) -> None:
        fmus = live.system.fmu
        self._outputs = outputs(fmus)
        self._others = {user: outputs(fmus, user) for user in live.scene.devices}
        self._turns, self._sent = 0, 0.0

    def send(self, live: LiveRun, link: Pipe, pulled: bool) -> None:
        """Send a frame, where the last one is FRAME ago. pulled: whether the first user pulls."""
        if (now := time.monotonic()) - self._sent > FRAME:
            self._sent = now
            link.send({"type": "frame", "pulled": pulled} | self.frame(live), frame=True)

    def handles(self, live: LiveRun) -> dict[str, list[float]]:
        """The poses (3,) of the handles by user, "" for the first one."""
        every = {"": self._outputs, **self._others}
        return {user: live[outputs["handle"]].tolist() for user, outputs in every.items()}

    def frame(self, live: LiveRun) -> dict[str, Any]:
        """The newest samples, and now and then what the meters have `booked`, the work (J) of the
        held and of the ideal effort by connection, with the energy `stored` in the mechanism, and
        the deadlines `missed`."""
        frame: dict[str, Any] = {k: live[name].tolist() for k, name in self._outputs.items()}
        if self._turns % SELDOM == 0:
            frame["booked"] = [[e.held, e.ideal] for e in live.energies().values()]
            frame["stored"] = float(live[MECHANISM_ENERGY][0])
        elif self._turns % SELDOM == 2:
            frame["missed"] = live.report()["deadlines_missed"]
        self._turns += 1
        if self._others:
            frame["others"] = {
                user: {k: live[name].tolist() for k, name in outputs.items()}
                for user, outputs in self._others.items()
            }
        return {"t": live.time} | frame
