"""A recorded trace of frames: `graphics.rate = { trace = "frames.csv" }`.

One time stamp (s) per line, increasing, in the first column of a CSV; a first line that is no
number is a header, and # starts a comment. Times count from the first stamp, at which the run
starts. The scene keeps the list of times instead of the file, so that run.json contains the frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault

LARGEST = 2**24
"""Bytes: some 10^6 frames, 4 h of them at 60 Hz."""
MAX_STAMP = Decimal("1e12")
"""Largest time stamp (s); seconds since 1970 are about 2e9."""


@dataclass(frozen=True, kw_only=True)
class Trace:
    """A recorded trace of frame times, in place of a rate."""

    trace: str
    """A CSV file, relative to the scene's file, whose first column holds the times (s) at which
    frames ended."""


def frame_times(path: Path) -> list[float]:
    """The ends of the frames (s), counted from the first stamp. Raises InputFault, with the line,
    for a file that is no trace."""
    lines = text_files.read(path, "a trace of frames", LARGEST).splitlines()
    stamps: list[Decimal] = []
    for number, line in enumerate(lines, start=1):
        field = line.partition("#")[0].split(",")[0].strip()
        if not field:
            continue
        try:
            stamp = Decimal(field)
            if not -MAX_STAMP < stamp < MAX_STAMP:
                raise InvalidOperation
        except InvalidOperation:  # not a number, or a comparison with "nan"
            if number == 1:
                continue
            raise InputFault(f"{path}: line {number}: {field[:100]!r} is no time in s") from None
        if stamps and not stamp > stamps[-1]:
            raise InputFault(f"{path}: line {number}: {field[:100]} s is not after {stamps[-1]} s")
        stamps.append(stamp)
    if len(stamps) < 2:
        raise InputFault(f"{path}: {len(stamps)} time stamps; a trace of frames has at least 2")
    # Decimals subtract exactly: 1.7 - 1.6 is 0.1.
    return [float(stamp - stamps[0]) for stamp in stamps[1:]]
