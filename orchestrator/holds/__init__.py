"""What stands on an input between two samples of its source. One hold a file.

A hold's class says what it `needs` ("derivative": samples are the signal and then its derivative;
"power": the connection carries it; "spring": it sets one; or None), whether it `gives_samples`,
unchanged, and the `degree` of the polynomial in time that it is within a step; 0 where it stands.
"""

from __future__ import annotations

from typing import Protocol

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.delayed import Delayed
from hapticlink.orchestrator.holds.first_order import FirstOrder
from hapticlink.orchestrator.holds.first_order_derivative import FirstOrderDerivative
from hapticlink.orchestrator.holds.hermite import Hermite
from hapticlink.orchestrator.holds.hold import Hold
from hapticlink.orchestrator.holds.lead import Lead
from hapticlink.orchestrator.holds.mean import Mean
from hapticlink.orchestrator.holds.nearly_energy_preserving import NearlyEnergyPreserving
from hapticlink.orchestrator.holds.passive import Passive
from hapticlink.orchestrator.holds.passive_set_position import PassiveSetPosition
from hapticlink.orchestrator.holds.second_order import SecondOrder
from hapticlink.orchestrator.holds.smooth import Smooth
from hapticlink.orchestrator.holds.zero_order import ZeroOrder


class HoldType(Protocol):
    @property
    def needs(self) -> str | None: ...

    @property
    def gives_samples(self) -> bool: ...

    @property
    def degree(self) -> int: ...

    def __call__(self, context: HoldContext) -> Hold: ...


HOLDS: dict[str, HoldType] = {
    "zoh": ZeroOrder,
    "lead": Lead,
    "foh": FirstOrder,
    "foh-derivative": FirstOrderDerivative,
    "second-order": SecondOrder,
    "hermite": Hermite,
    "delayed": Delayed,
    "smooth": Smooth,
    "passive": Passive,
    "nepce": NearlyEnergyPreserving,
    "pspm": PassiveSetPosition,
    "latest": ZeroOrder,
    "mean": Mean,
}
