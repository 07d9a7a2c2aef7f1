"""Figures as files. The same figure gives the same bytes: no date, no version, no random name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import InputFault, unknown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "svg": {"Date": None, "Creator": None},
}
"""By format, what of its own Matplotlib leaves out."""
LOOK: Any = {
    "text.hinting": "none",
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "hapticlink",
}
"""Letters that are not fitted to dots keep their widths, and a PNG takes a seventh less time. A PDF
embeds TrueType fonts, which journals ask for, and an SVG the outlines of its letters."""
_drawing = Lock()


def formats(given: str) -> tuple[str, ...]:
    """The formats of figures in a text such as `pdf,svg`. Raises InputFault for an unknown one."""
    asked = tuple(dict.fromkeys(each.strip().lower() for each in given.split(",")))
    for each in asked:
        if each not in METADATA:
            raise InputFault(f"--format {given}: {unknown('format', each, METADATA)}")
    return asked


def encode(
    figure: Figure, kind: str, dpi: int = 150, more: Mapping[str, str] | None = None
) -> bytes:
    """A figure as a file of a format; dpi: dots per inch of a PNG; more: further metadata."""
    from matplotlib import rc_context

    how: dict[str, Any] = {"pil_kwargs": {"compress_level": 1}} if kind == "png" else {}
    file = BytesIO()
    with _drawing, rc_context(LOOK):  # of the process: threads draw one after the other
        metadata = {**METADATA[kind], **(more or {})}
        figure.savefig(file, format=kind, dpi=dpi, metadata=metadata, **how)
    return file.getvalue()


def save(figures: Mapping[str, Figure], folder: Path) -> list[str]:
    """Write each figure as a PNG; returns the file names. Raises Interrupted."""
    return write(
        ((f"{name}.png", encode(figure, "png")) for name, figure in figures.items()), folder
    )


def write(files: Iterable[tuple[str, bytes]], folder: Path) -> list[str]:
    """Writes files by name; returns the names. Raises Interrupted."""
    names = []
    for name, content in files:
        interrupt.raise_if_interrupted()
        path = folder / name
        path.unlink(missing_ok=True)  # a link is replaced, not followed
        path.write_bytes(content)
        names.append(name)
    return names
