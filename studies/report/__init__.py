"""Reproduces the report's figures from runs of the FMUs, and compares all that the report states
with what was found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.results import folders
from studies.report import (
    chapter1,
    chapter3,
    chapter4,
    chapter6,
    cost_of_sensing,
    graphics_copy,
    section_b6,
)
from studies.report.report_page import Entry, Runs, write
from studies.report.statements import every_statement, table

CHAPTERS = (chapter1, chapter3, chapter4, chapter6, cost_of_sensing, graphics_copy, section_b6)


def reproduce(folder: Path, tell: Callable[[str], None] = lambda _: None) -> Path:
    """Write figures, README.md and the table of statements to `folder`; `tell` is called with
    messages on the progress. Returns the page's path; raises InputFault if `folder` cannot be
    written to."""
    folders.ensure(folder)
    entries: list[Entry] = []
    with temporary_folders.temporary_folder() as room:
        runs = Runs(room, tell)
        # Figure 1.4 comes last: it steps an FMU of Python in this process, and runs after it would
        # give each of theirs a process of its own.
        for chapter in reversed(CHAPTERS):
            made = list(chapter.entries(runs, folder))
            for entry in made:
                tell(f"{entry.title}: {entry.figure}")
            entries[:0] = made
            if chapter is chapter3:
                stated = every_statement(runs)
    return write(folder, entries, table.write(folder, stated))
