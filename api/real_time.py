"""Runs a scene in real time, and changes it while it runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hapticlink.api import runs
from hapticlink.api.result import Run
from hapticlink.orchestrator.real_time_session import LiveRun


class RealTime(LiveRun):
    """A scene that runs in real time and is watched and changed meanwhile, as by a page on which a
    mouse is the hand.

    `scene` and `options` are those of `hl.scene`. `run` calls its `turn` with this object about
    every 20 ms, between two events of the haptic loop, which waits for it: a turn has to be short.
    Everything else is for a turn to use. What a change acts on is the running FMUs, holds and
    clocks themselves; run.json lists the changes with their times (`changes` of `real_time`).
    """

    def run(
        self,
        turn: Callable[[RealTime], object],
        out: str | Path | None = None,
        tables: bool = True,
        every: float = 0.02,
        figures: bool = True,
    ) -> Run:
        """Run the scene to its duration, or until `stop`; results as of `hl.run`. After a `reset`
        they are those from then on. Without `out` and `tables` they have no tables. Turns come
        about `every` so many seconds."""
        drawn = ("png",) if figures else ()
        return self._repeated(
            turn, every, lambda pace: runs.run_paced(self.scene, out, pace, drawn, tables=tables)
        )
