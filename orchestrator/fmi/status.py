"""The statuses that functions of an FMU return (FMI 2.0.5 section 2.1.3, FMI 3.0 section 2.2.3)."""

from __future__ import annotations

import ctypes
from typing import Any

from fmpy.fmi1 import FMICallException

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4


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
