"""The connection of a hold: what the hold may know besides the samples of its source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hapticlink.orchestrator.base.arrays import Vector

if TYPE_CHECKING:
    from hapticlink.orchestrator.holds.energy_tank import EnergyTank


@dataclass(frozen=True)
class HoldContext:
    """What a hold is constructed from.

    size: number of entries of the signal. seconds: converts ticks to s. displacement: reads the
    displacement conjugate to the signal, with its sign, so that signal . d(displacement) is the
    work done on the target (J). velocity: reads its time derivative, where the target has it as
    an output. tank: the energy tank of the spring-damper that the signal sets, and the row of the
    signal in it (0: set position, 1: set velocity).
    """

    size: int
    seconds: Callable[[float], float] = float
    displacement: Callable[[], Vector] | None = None
    velocity: Callable[[], Vector] | None = None
    tank: tuple[EnergyTank, int] | None = None
