"""The page: beside each figure what the report states and what was found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hapticlink.orchestrator.report.entry import Entry

HEAD = """# The report's figures, from runs of the FMUs

Made by `hapticlink reproduce`. The report is the traineeship report *Haptic manipulation of
virtual linkages with closed loops* (University of Victoria), whose device has
no printed dimensions: those used here are assumed (`components/specs/`), so trajectories are
compared by what they show, not point by point. Graphics at 30 Hz, haptics at 512 Hz, zero-order
holds, Gauss-Seidel order (no added delay) where nothing else is said.
"""


def write(folder: Path, entries: Sequence[Entry]) -> Path:
    """README.md of the folder."""
    parts = [HEAD]
    for e in entries:
        parts.append(
            f"## {e.title}\n\n![{e.title}]({e.figure})\n\n- Stated: {e.stated}.\n"
            f"- Found: {e.found}.\n- Run: `{e.command}`\n"
        )
    path = folder / "README.md"
    path.write_text("\n".join(parts), encoding="utf-8")
    return path
