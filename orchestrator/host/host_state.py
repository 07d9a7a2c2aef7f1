"""What FMUs in the process of a run share with it and may change, restored: the current directory,
the standard streams, the limit of recursion, numpy's handling of errors, and how this thread rounds
numbers, which the compiled loop restores in C (process_state.c).
"""

from __future__ import annotations

import ctypes
import logging
import os
import platform
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import numpy as np


@contextmanager
def restore_interpreter() -> Iterator[None]:
    """After the context streams, limit of recursion and numpy's handling of errors are those from
    before it; the first two, which all threads share, only where this is the main one."""
    streams, limit = (sys.stdout, sys.stderr), sys.getrecursionlimit()
    with np.errstate():
        try:
            yield
        finally:
            if threading.current_thread() is threading.main_thread():
                sys.stdout, sys.stderr = streams
                sys.setrecursionlimit(limit)


@contextmanager
def restore_directory(*suspects: str) -> Iterator[None]:
    """After the context the current directory is the one from before it. That it was changed is
    logged as a warning, with the FMUs one of which has changed it."""
    before = _directory()
    try:
        yield
    finally:
        after = _directory()
        if before is not None and after != before:
            os.chdir(before)
            logging.getLogger(__name__).warning(
                "%s changed the current directory to %s: it is %s again",
                f"one of {', '.join(suspects)}" if len(suspects) > 1 else "".join(suspects),
                after or "a folder that was removed",
                before,
            )


def _directory() -> str | None:
    """The current directory; None where it has been removed."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return None


_libm: ctypes.CDLL | None = None
if sys.platform != "win32":
    with suppress(OSError):
        _libm = ctypes.CDLL("libm.so.6" if sys.platform == "linux" else None)
_HAS_MXCSR = sys.platform == "linux" and platform.machine() == "x86_64"
_Environment = ctypes.c_uint32 * 64
"""At least as large as any fenv_t; on Linux with x86-64 the last of its 8 numbers is MXCSR."""
_now, _before = _Environment(), _Environment()


def _rounding() -> int:
    """The rounding mode; on x86-64 with the masks of exceptions and how tiny numbers are taken."""
    assert _libm is not None
    if not _HAS_MXCSR:
        return int(_libm.fegetround())
    _libm.fegetenv(_now)
    return (_now[7] & 0xFFC0) << 16 | (_now[0] & 0xC00)


_expected = 0
if _libm is not None:
    _libm.fegetenv(_before)
    _expected = _rounding()


def restore_rounding() -> bool:
    """Round as when this module was loaded; whether it was otherwise."""
    if _libm is None or _rounding() == _expected:
        return False
    _libm.fesetenv(_before)
    return True
