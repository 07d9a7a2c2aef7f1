"""Values between a vector and an FMU, one C call for each FMI type."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.description import TYPES, Scalar

Vector = NDArray[np.float64]


class Transfer:
    """The scalars of one FMI type within a vector, and the C call that moves them."""

    def __init__(
        self, slave: Any, verb: str, scalars: Sequence[Scalar], type_: str, values: Vector
    ) -> None:
        chosen = [i for i, s in enumerate(scalars) if s.type == type_]
        self.name = f"fmi2{verb}{type_}"
        self._values = values[chosen[0] : chosen[-1] + 1]
        self._buffer = self._values if type_ == "Real" else np.zeros(len(chosen), np.int32)
        # Argument objects and pointers are made once; a fresh function has no other types set.
        self._transfer: Callable[[], int] = partial(
            slave.dll[self.name],
            ctypes.c_void_p(slave.component),
            (ctypes.c_uint * len(chosen))(*(scalars[i].reference for i in chosen)),
            ctypes.c_size_t(len(chosen)),
            ctypes.c_void_p(self._buffer.ctypes.data),
        )
        through = {"Get": self._get, "Set": self._set}[verb]
        self.call: Callable[[], int] = self._transfer if type_ == "Real" else through

    def _get(self) -> int:
        status = self._transfer()
        self._values[:] = self._buffer
        return status

    def _set(self) -> int:
        self._buffer[:] = self._values
        return self._transfer()


def transfers(slave: Any, verb: str, scalars: Sequence[Scalar], values: Vector) -> list[Transfer]:
    """One for each type present; `scalars` are sorted by type."""
    present = [t for t in TYPES if any(s.type == t for s in scalars)]
    return [Transfer(slave, verb, scalars, t, values) for t in present]
