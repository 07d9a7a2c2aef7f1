"""Where an instance stands, in memory that the compiled loop shares."""

from __future__ import annotations

import ctypes


class Place(ctypes.Structure):
    """time: where the instance stands. begin, size, end: of its newest step. step_time: spent in
    doStep. All in s. ended: whether it has requested the end of the simulation. waiting: whether
    there are settings that it is to take before its next step."""

    _fields_ = (
        *((name, ctypes.c_double) for name in ("time", "begin", "size", "end", "step_time")),
        ("ended", ctypes.c_int64),
        ("waiting", ctypes.c_int64),
    )
