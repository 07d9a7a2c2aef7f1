"""The statuses that functions of an FMU return (FMI 2.0.5 section 2.1.3, FMI 3.0 section 2.2.3).

An FMU requests the end of the simulation in FMI 2.0 by a step that it discards (fmi2Terminated, FMI
2.0.5 section 4.2.3), in FMI 3.0 by a step that it takes (terminateSimulation, FMI 3.0 section
4.2.1).
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fmpy.fmi1 import FMICallException

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4
LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3  # fmi2StatusKind
SHARE = 1e-6
"""Of a step: how close to its end an FMU must have come to have taken it whole."""


def succeeded(status: int) -> bool:
    """Whether a call that returned `status` has done what it was asked for: it has with ok (0) and
    warning (1) only. A number that FMI does not define, such as -1, is no success. The compiled
    loop has the same decision in C (`fmu_succeeded` in loop.h)."""
    return status in (0, WARNING)


def worse(status: int, other: int) -> int:
    """The worse of two statuses; one that FMI does not define counts as an error."""
    return max(s if 0 <= s <= FATAL else ERROR for s in (status, other))


def require_success(slave: Any) -> None:
    """Have every call by a method of FMPy's `slave` that returns a status raise FMICallException
    where it did not succeed: FMPy itself takes negative ones for a success."""
    call = slave._call

    def checked(name: str, *arguments: Any) -> Any:
        result = call(name, *arguments)
        if slave._functions[name].restype is ctypes.c_int and not succeeded(result):
            raise FMICallException(function=name, status=result)
        return result

    slave._call = checked


def make_end_query(slave: Any) -> Callable[[float], float | None]:
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
