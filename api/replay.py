"""Replays of runs."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path

from hapticlink.orchestrator.results.read_results import Results
from hapticlink.visualization.replay import replay_page
from hapticlink.visualization.replay.recorded_frames import Recorded

HEIGHT = 720
"""Of a replay in a notebook (px)."""


@dataclass(frozen=True, repr=False, eq=False)
class Replay:
    """A replay of one run or of two beside each other. A notebook shows it as the value of a
    cell."""

    runs: tuple[Recorded, ...]

    def write(self, path: str | Path) -> None:
        """Write a page that opens without a network, .html, or an animation of the drawing, .gif,
        .webp or .png. Raises InputFault for another ending, or if `path` cannot be written."""
        replay_page.require_written(Path(path))
        replay_page.write_replay(self.runs, Path(path))

    def __repr__(self) -> str:
        return f"replay of {', '.join(run.name for run in self.runs)}: write() makes a page of it"

    def _repr_html_(self) -> str:
        page = escape(replay_page.html(self.runs))
        return f'<iframe srcdoc="{page}" style="width:100%;height:{HEIGHT}px;border:0"></iframe>'


def view(*runs: Results | Path | str) -> Replay:
    """Replay `runs`, one or two: results of `run` or `load`, or folders. In a notebook the value of
    a cell is shown, elsewhere `view(r).write("replay.html")` writes a page.

    Raises InputFault for a run without a linkage, or whose poses are not recorded.
    """
    return Replay(tuple(map(Recorded, runs)))
