"""Standard streams on which every command can rely, whoever has started it."""

from __future__ import annotations

import os
import sys
from io import TextIOWrapper


def ensure() -> None:
    """Opens those of the three that are closed as the null device, so that no file of a run gets
    their numbers, to which FMUs may write; and makes characters that the terminal's encoding lacks
    escapes."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # it takes the lowest free number
    sys.stdout = sys.stdout or open(1, "w", closefd=False)  # noqa: SIM115
    sys.stderr = sys.stderr or open(2, "w", closefd=False)  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
