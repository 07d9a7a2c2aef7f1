"""The loops in C that call FMUs and do nothing else."""

from __future__ import annotations

import ctypes
from pathlib import Path

from hapticlink.fmus.native import compile_library

SOURCE = Path(__file__).with_suffix(".c")


def bare_loop(folder: Path) -> ctypes.CDLL:
    """The library of bare_loop.c, compiled in `folder`."""
    library = folder / "bare.so"
    if not library.exists():
        compile_library(SOURCE, library)
    return ctypes.CDLL(str(library))
