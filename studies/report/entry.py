"""An entry of the page, and the runs that its chapters share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.tables import Results
from hapticlink.orchestrator.scene.overrides import as_typed


@dataclass(frozen=True)
class Entry:
    """A figure of the report: what the report states about it, what was found, and the command that
    runs it."""

    title: str
    figure: str
    stated: str
    found: str
    command: str


@dataclass
class Runs:
    """Runs by scene and options, each run only once, with results in the folder `room`."""

    room: Path
    tell: Callable[[str], None]
    _made: dict[tuple[str, ...], Results] = field(default_factory=dict)

    def __call__(self, scene: str, *options: str) -> Results:
        key = (scene, *options)
        if key not in self._made:
            self.tell(f"running {command(scene, *options)}")
            folder = self.room / str(len(self._made))
            self._made[key] = simulate(scene, folder, options).results
            interrupt.check()
        return self._made[key]


def command(scene: str, *options: str) -> str:
    """The command line of a run."""
    return " ".join(["hapticlink run", scene, *map(as_typed, options)])
