"""Holds: they give the value of an input between two samples of its source."""

from __future__ import annotations

from typing import Any, get_args

from hapticlink.components.registry import Registry, no_subclass
from hapticlink.orchestrator.holds.hold import Hold, HoldContext, Needs
from hapticlink.orchestrator.holds.mean import Mean
from hapticlink.orchestrator.holds.nearly_energy_preserving import NearlyEnergyPreserving
from hapticlink.orchestrator.holds.passive import Passive
from hapticlink.orchestrator.holds.passive_set_position import PassiveSetPosition
from hapticlink.orchestrator.holds.polynomial_holds import (
    Delayed,
    FirstOrder,
    FirstOrderDerivative,
    Hermite,
    Lead,
    SecondOrder,
    Slope,
    Smooth,
)
from hapticlink.orchestrator.holds.zero_order import Latest, ZeroOrder

__all__ = ["HOLDS", "Hold", "HoldContext"]


def _misfit(part: Any) -> str:
    """Why a part is no hold, "" if it is one."""
    if why := no_subclass(part, Hold):
        return why
    known = (None, *get_args(Needs))
    return "" if part.needs in known else f"needs {part.needs!r}, which is none of {known}"


HOLDS: Registry[type[Hold]] = Registry(
    "hold",
    {
        "zoh": ZeroOrder,
        "lead": Lead,
        "foh": FirstOrder,
        "foh-derivative": FirstOrderDerivative,
        "slope": Slope,
        "second-order": SecondOrder,
        "hermite": Hermite,
        "delayed": Delayed,
        "smooth": Smooth,
        "passive": Passive,
        "nepce": NearlyEnergyPreserving,
        "pspm": PassiveSetPosition,
        "latest": Latest,
        "mean": Mean,
    },
    _misfit,
)
