"""FMUs in the place of the haptic loop's own blocks, and what they lack of those."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from hapticlink.fmus.blocks import component
from hapticlink.fmus.errors import FmuError
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.scene.blocks import BlockPlan
from hapticlink.orchestrator.scene.records import Wire
from hapticlink.orchestrator.system.system import Connection, Fmu, Replacement

if TYPE_CHECKING:
    from hapticlink.components.component import Component


def replaced(plans: Mapping[str, BlockPlan]) -> dict[str, Component]:
    """The blocks that FMUs replace, by name. Raises InputFault where the settings of one give no
    block."""
    try:
        return {name: component(plan.block, plan.settings) for name, plan in plans.items()}
    except FmuError as error:
        raise InputFault(str(error)) from error


def replacements(
    blocks: Mapping[str, Component],
    rows: Iterable[Wire],
    fmus: Iterable[Fmu],
    connections: Iterable[Connection],
) -> dict[str, Replacement]:
    """By replaced block. `rows` are all connections that the haptic loop may have."""
    rows, connections = tuple(rows), tuple(connections)
    described = {u.name: u.description for u in fmus}
    ports = {name: {s.port for s in found.scalars} for name, found in described.items()}

    def lost(name: str, block: Component) -> Iterator[str]:
        variables = (*block.inputs, *block.parameters, *block.outputs)
        before = {**ports, name: {v.name for v in variables}}
        for row in rows:
            ends = [end.split(".", 1) for end in (row.from_, row.to)]
            there = [
                all(port in known.get(fmu, ()) for fmu, port in ends) for known in (before, ports)
            ]
            if name in (ends[0][0], ends[1][0]) and there == [True, False]:
                yield f"{row.from_} -> {row.to}"

    def unfed(name: str) -> Iterator[str]:
        fed = {s.name for c in connections if c.target == name for s in c.inputs}
        inputs = (s for s in described[name].scalars if s.causality == "input")
        yield from dict.fromkeys(s.port for s in inputs if s.name not in fed)

    return {
        name: Replacement(tuple(lost(name, block)), tuple(unfed(name)))
        for name, block in blocks.items()
        if name in described
    }
