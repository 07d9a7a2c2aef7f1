"""What a Python FMU in the process of the run shares with it, and may change: the standard streams,
the limit of recursion, numpy's handling of errors."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


@contextmanager
def restored() -> Iterator[None]:
    """After the context they are those from before it; the streams and the limit, which all threads
    share, only where this is the main one."""
    streams, limit = (sys.stdout, sys.stderr), sys.getrecursionlimit()
    with np.errstate():
        try:
            yield
        finally:
            if threading.current_thread() is threading.main_thread():
                sys.stdout, sys.stderr = streams
                sys.setrecursionlimit(limit)
