"""A page that replays one or two recorded runs, as one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.results.folders import names
from hapticlink.visualization.browser_code import one_file
from hapticlink.visualization.mechanism.marks import KINDS, SHAPES
from hapticlink.visualization.replay.recorded_frames import Recorded

WRITTEN = (".html", ".gif", ".webp", ".png")
"""Endings of the files that a replay can be written to."""


def html(runs: Sequence[Recorded]) -> str:
    """The page. The same runs give the same bytes."""
    runs_as_json = [
        run.message() | {"short": name} for run, name in zip(runs, _names(runs), strict=True)
    ]
    data = {"runs": runs_as_json, "kinds": KINDS, "shapes": SHAPES}
    return one_file.page("replay.html", {"data": one_file.as_json(data)})


def _names(runs: Sequence[Recorded]) -> list[str]:
    written = [folder for run in runs if (folder := run.results.folder)]
    return names(written) if len(written) == len(runs) else [run.name for run in runs]


def require_written(path: Path) -> None:
    """Raises InputFault for a file of a kind that no replay can be written to."""
    if path.suffix.lower() not in WRITTEN:
        raise InputFault(f"--export {path}: name a file that ends in {', '.join(WRITTEN)}")
    folders.ensure(path.parent, "--export")


def write_replay(runs: Sequence[Recorded], path: Path) -> None:
    """Writes the replay of the runs as a page or, by the file's name, as an animation."""
    if path.suffix.lower() == ".html":
        with atomic_file(path) as unfinished:
            unfinished.write_text(html(runs), encoding="utf-8")
        return
    from hapticlink.visualization.replay import animation  # with Matplotlib, slow to load

    with atomic_file(path) as unfinished:
        animation.write_animation(runs, _names(runs), unfinished)
