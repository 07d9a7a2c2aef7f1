"""An FMU that requests the end of the simulation: in FMI 2.0 by a step that it discards
(fmi2Terminated, FMI 2.0.5 section 4.2.3), FMI 3.0 by a step that it takes (terminateSimulation, FMI
3.0 section 4.2.1)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3  # fmi2StatusKind
SHARE = 1e-6
"""Of a step: how close to its end an FMU must have come to have taken it whole."""


def ended_in_discard(slave: Any) -> Callable[[float], float | None]:
    """A function that returns, after a step from a time (s) was discarded, the time at which the
    FMU ended, None if it has not. pythonfmu 0.7 and pythonfmu3 0.3 say fmi2Terminated of every
    discard, so their FMUs are not asked."""
    if (Path(slave.unzipDirectory) / "resources" / "slavemodule.txt").exists():
        return lambda begin: None
    component = ctypes.c_void_p(slave.component)
    asks, time = ctypes.c_int(), ctypes.c_double()
    terminated, last = slave.dll["fmi2GetBooleanStatus"], slave.dll["fmi2GetRealStatus"]

    def ended(begin: float) -> float | None:
        if terminated(component, TERMINATED, ctypes.byref(asks)) or not asks:
            return None
        unknown = last(component, LAST_SUCCESSFUL_TIME, ctypes.byref(time))
        return begin if unknown else time.value

    return ended
