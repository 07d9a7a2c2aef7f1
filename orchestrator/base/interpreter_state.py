"""What FMUs in the process of the run share with it, and may change: the current directory, the
standard streams, the limit of recursion, numpy's handling of errors."""

from __future__ import annotations

import logging
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


@contextmanager
def restored() -> Iterator[None]:
    """After the context all but the directory are those from before it; the streams and the limit,
    which all threads share, only where this is the main one."""
    streams, limit = (sys.stdout, sys.stderr), sys.getrecursionlimit()
    with np.errstate():
        try:
            yield
        finally:
            if threading.current_thread() is threading.main_thread():
                sys.stdout, sys.stderr = streams
                sys.setrecursionlimit(limit)


@contextmanager
def directory_restored(*suspects: str) -> Iterator[None]:
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
