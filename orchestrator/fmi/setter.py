"""Sets inputs of an FMU in this process from a signal vector: values, and derivatives of those that
vary within a step."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import partial
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.fmi.instance import Place
from hapticlink.orchestrator.fmi.status import succeeded
from hapticlink.orchestrator.fmi.transfer import Transfer, transfers
from hapticlink.orchestrator.fmi.units import SAME, Linear
from hapticlink.orchestrator.fmi.variables import Scalar

Setting = tuple[Vector, NDArray[np.intp] | None, Sequence[Transfer]]
"""`whole`, `into` and `transfers` of a Setter."""


class Setter:
    """values[i] = factors[i] signals[where[i]] + offsets[i], then the calls of `transfers`, unless
    the FMU has these values: inputs keep theirs (FMI 2.0.5 section 2.1.7).

    place: of the FMU. key: of this among the setters of the FMU, 0 where the FMU may change its
    inputs itself, which are then set each time. factors and offsets are None where all are 1 and 0.
    Of arrays that are set as a whole, `into` are the places of the values in `whole`, else None.
    carry_out makes the calls.
    """

    def __init__(
        self,
        where: Sequence[int],
        conversions: Sequence[Linear],
        setting: Setting,
        carry_out: Callable[[Sequence[Transfer]], None],
        place: Place,
        key: int,
    ) -> None:
        self.place, self.key, self._before = place, key, b""
        self.where, self._carry_out = np.array(where, dtype=np.intp), carry_out
        self.whole, self.into, self.transfers = setting
        self.values = self.whole if self.into is None else np.zeros(len(where))
        self.factors: Vector | None = None
        self.offsets: Vector | None = None
        if any(c != SAME for c in conversions):
            self.factors = np.array([c.factor for c in conversions])
            self.offsets = np.array([c.offset for c in conversions])

    def __call__(self, signals: Vector) -> None:
        if self.place.ended:
            return
        # "raise" would copy through a buffer.
        signals.take(self.where, out=self.values, mode="clip")
        if self.factors is not None and self.offsets is not None:
            self.values.__imul__(self.factors).__iadd__(self.offsets)
        before, self._before = self._before, self.values.tobytes()
        if self.key and self.place.setter == self.key and self._before == before:
            return
        if self.into is not None:
            self.whole[self.into] = self.values
        self.place.setter = 0
        self._carry_out(self.transfers)
        self.place.setter = self.key


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
