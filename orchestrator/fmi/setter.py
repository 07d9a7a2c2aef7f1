"""Sets inputs of an FMU in this process from a signal vector."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.fmi.instance import StepState
from hapticlink.orchestrator.fmi.transfer import Transfer
from hapticlink.orchestrator.fmi.units import Linear, factors_and_offsets

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
        place: StepState,
        key: int,
    ) -> None:
        self.place, self.key, self._before = place, key, b""
        self.where, self._carry_out = np.array(where, dtype=np.intp), carry_out
        self.whole, self.into, self.transfers = setting
        self.values = self.whole if self.into is None else np.zeros(len(where))
        self.factors: Vector | None = None
        self.offsets: Vector | None = None
        if converted := factors_and_offsets(conversions):
            self.factors, self.offsets = converted

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
