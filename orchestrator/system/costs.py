"""Operations and signals of a scene's blocks, as it is and with nothing left out."""

from __future__ import annotations

from dataclasses import dataclass

from hapticlink.fmus.cost import Cost, cost
from hapticlink.fmus.errors import FmuError
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.fmu_files import settled


@dataclass(frozen=True)
class BlockCost:
    """A block's cost, and how often it steps in a haptic tick (below 1 for the graphics rate)."""

    name: str
    cost: Cost
    steps: float

    @property
    def operations(self) -> float:
        """A haptic tick, on the average."""
        return self.steps * (self.cost.step + self.cost.output)

    @property
    def signals(self) -> float:
        """Inputs set and outputs read in a haptic tick, on the average."""
        ports = (*self.cost.inputs.values(), *self.cost.outputs.values())
        return self.steps * sum(ports)


def costs(scene: Scene, timeline: Timeline, *, skip: bool = True) -> tuple[BlockCost, ...]:
    """Of every block; skip=False counts what the scene leaves out as well. Raises InputFault."""
    tick = timeline.clock("haptics").longest
    clocks = {clock.name for clock in timeline.clocks}
    found = []
    for block in blocks(scene, skip=skip):
        # A rate that nothing runs at has no clock; what is left out would run at it.
        clock = timeline.of.get(block.name, str(block.rate))
        period = timeline.clock(clock).longest if clock in clocks else tick
        try:
            made = cost(block.made_by, settled(scene, block, timeline), timeline.seconds(period))
        except FmuError as error:
            raise InputFault(str(error)) from error
        found.append(BlockCost(block.name, made, tick / period))
    return tuple(found)
