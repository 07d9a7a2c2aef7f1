"""Reproduces the report's figures from runs of the FMUs, and compares what the report states with
what was found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.results import folders
from studies.report import chapter1, chapter3, chapter4, chapter6, graphics_copy, section_b6
from studies.report.report_page import Entry, Runs, write

CHAPTERS = (chapter1, chapter3, chapter4, chapter6, graphics_copy, section_b6)


def reproduce(folder: Path, tell: Callable[[str], None] = lambda _: None) -> Path:
    """Write figures and README.md to `folder`; `tell` is called with messages on the progress.
    Returns the page's path; raises InputFault if `folder` cannot be written to."""
    folders.ensure(folder)
    entries: list[Entry] = []
    with temporary_folders.temporary_folder() as room:
        runs = Runs(room, tell)
        for chapter in CHAPTERS:
            for entry in chapter.entries(runs, folder):
                tell(f"{entry.title}: {entry.figure}")
                entries.append(entry)
    return write(folder, entries)
