"""Where an instance stands, in memory that the compiled loop shares."""

from __future__ import annotations

import ctypes
import math


class Place(ctypes.Structure):
    """time: where the instance stands. begin, size, end: of its newest step. step_time: spent in
    doStep. All in s. ended: whether it has requested the end of the simulation. waiting: from
    when on there are settings that it is to take before a step, infinity where there are none.
    setter: the key of the Setter whose values its inputs have, 0 where that is not known. altered:
    the number of its calls that changed how this process rounds numbers. The others count the calls
    of its functions in the loop."""

    _fields_ = (
        *((n, ctypes.c_double) for n in ("time", "begin", "size", "end", "step_time", "waiting")),
        *((name, ctypes.c_int64) for name in ("ended", "setter", "altered")),
        *((name, ctypes.c_int64) for name in ("gets", "sets", "steps", "saves", "rollbacks")),
    )

    def __init__(self) -> None:
        super().__init__(waiting=math.inf)

    def calls(self) -> dict[str, int]:
        """The number of calls of the loop by kind, without those that were not made."""
        counts = {name: getattr(self, name + "s") for name in _CALLS}
        return {name: count for name, count in counts.items() if count}

    def start(self) -> None:
        """Count from here."""
        for name in _CALLS:
            setattr(self, name + "s", 0)


_CALLS = ("get", "rollback", "save", "set", "step")
