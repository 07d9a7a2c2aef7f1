"""Computational cost of a scene's blocks: arithmetic operations and signals per haptic tick."""

from __future__ import annotations

from dataclasses import dataclass

from hapticlink.fmus.cost import Cost, cost
from hapticlink.fmus.errors import FmuError
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.scene import Scene


@dataclass(frozen=True)
class BlockCost:
    """The cost of a block and its steps per haptic tick (below 1 at the graphics rate)."""

    name: str
    cost: Cost
    steps: float

    @property
    def operations(self) -> float:
        """Arithmetic operations per haptic tick, on average."""
        return self.steps * self.cost.step

    @property
    def signals(self) -> float:
        """Inputs set and outputs read per haptic tick, on average."""
        ports = (*self.cost.inputs.values(), *self.cost.outputs.values())
        return self.steps * sum(ports)


def costs(scene: Scene, timeline: Timeline, *, skip: bool = True) -> tuple[BlockCost, ...]:
    """The cost of each block of `scene`; skip=False includes blocks and outputs that nothing needs.

    Raises InputFault where no FMU can be built from the settings.
    """
    tick = timeline.clock("haptics").longest
    clocks = {clock.name for clock in timeline.clocks}
    rows = []
    for block in blocks(scene, skip=skip).built:
        # A block that the scene skips may have a rate that no clock runs at.
        clock = timeline.of.get(block.name, str(block.rate))
        period = timeline.clock(clock).longest if clock in clocks else tick
        try:
            counted = cost(block.block, block.settings)
        except FmuError as error:
            raise InputFault(str(error)) from error
        rows.append(BlockCost(block.name, counted, tick / period))
    return tuple(rows)
