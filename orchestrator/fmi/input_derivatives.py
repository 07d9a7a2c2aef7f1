"""Inputs of one FMU that vary within its step: their values and derivatives at its beginning."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import partial
from math import factorial
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.fmi.status import succeeded
from hapticlink.orchestrator.fmi.transfer import transfers
from hapticlink.orchestrator.fmi.variables import Scalar


class Varying:
    """Inputs with their time derivatives: rows of (scalar, order, index in the signal vector),
    order 0 first. Values hold at the beginning of a step (FMI 2.0.5 section 4.2.1); if a step is
    taken in parts, `renew` extrapolates them to the beginning of each part.
    """

    name = "fmi2SetRealInputDerivatives"

    def __init__(
        self, slave: Any, scalars: Sequence[Scalar], orders: Sequence[int], places: Sequence[int]
    ) -> None:
        self._places = np.array(places, dtype=np.intp)
        self._factors = np.array([s.conversion.factor for s in scalars])
        pairs = zip(scalars, orders, strict=True)
        self._offsets = np.array([0.0 if order else s.conversion.offset for s, order in pairs])
        self._rows = list(zip((s.reference for s in scalars), orders, strict=True))
        self._first, self._now = np.zeros(len(orders)), np.zeros(len(orders))
        constant = orders.count(0)
        (values,) = transfers(slave, "2", "Set", scalars[:constant], self._now[:constant])
        self._set_values = values.call
        self._set_derivatives: Callable[[], int] = partial(
            slave.dll[self.name],
            ctypes.c_void_p(slave.component),
            (ctypes.c_uint * len(orders[constant:]))(*(r for r, _ in self._rows[constant:])),
            ctypes.c_size_t(len(orders) - constant),
            (ctypes.c_int * len(orders[constant:]))(*orders[constant:]),
            ctypes.c_void_p(self._now[constant:].ctypes.data),
        )

    def set(self, signals: Vector) -> int:
        """Set the derivatives; the values are set together with all other inputs."""
        self._first[:] = self._now[:] = signals[self._places] * self._factors + self._offsets
        return self._set_derivatives()

    def renew(self, elapsed: float) -> int:
        """Set values and derivatives for `elapsed` s after the beginning of the step."""
        for i, (reference, order) in enumerate(self._rows):
            self._now[i] = sum(
                self._first[j] * elapsed ** (other - order) / factorial(other - order)
                for j, (same, other) in enumerate(self._rows)
                if same == reference and other >= order
            )
        status = self._set_values()
        return self._set_derivatives() if succeeded(status) else status
