"""FMUs in the place of the haptic loop's own blocks, and what they lack of those."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from hapticlink.fmus.blocks import component
from hapticlink.fmus.errors import FmuError
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.scene.blocks import BlockPlan
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import Wire
from hapticlink.orchestrator.scene.toml_keys import Problem
from hapticlink.orchestrator.system.system import Replacement, System

if TYPE_CHECKING:
    from hapticlink.components.component import Component, Variable

MAX_PORTS = 12
"""Ports of one kind that a message lists."""


def find_replaced_blocks(plans: Mapping[str, BlockPlan]) -> dict[str, Component]:
    """The blocks that FMUs replace, by name. Raises InputFault where the settings of one give no
    block."""
    try:
        return {name: component(plan.block, plan.settings) for name, plan in plans.items()}
    except FmuError as error:
        raise InputFault(str(error)) from error


def replacements(
    blocks: Mapping[str, Component],
    rows: Iterable[Wire],
    system: System,
    mapped: Mapping[str, Mapping[str, tuple[str, ...]]],
) -> dict[str, Replacement]:
    """By replaced block. `rows` are all connections that the haptic loop may have."""
    described = {u.name: u.description for u in system.fmus}
    ports = {name: {s.port for s in description.scalars} for name, description in described.items()}

    def lost(name: str, block: Component) -> Iterator[str]:
        variables = (*block.inputs, *block.parameters, *block.outputs)
        before = {**ports, name: {v.name for v in variables}}
        for row in rows:
            ends = [end.split(".", 1) for end in (row.from_, row.to)]
            there = [
                all(port in known.get(fmu, ()) for fmu, port in ends) for known in (before, ports)
            ]
            if name in (ends[0][0], ends[1][0]) and there == [True, False]:
                yield row.name

    def unfed(name: str) -> Iterator[str]:
        fed = {s.name for c in system.connections if c.target == name for s in c.inputs}
        inputs = (s for s in described[name].scalars if s.causality == "input")
        yield from dict.fromkeys(s.port for s in inputs if s.name not in fed)

    return {
        name: Replacement(tuple(lost(name, block)), tuple(unfed(name)), mapped[name])
        for name, block in blocks.items()
        if name in described
    }


def check_replacements(
    scene: Scene, blocks: Mapping[str, Component], rows: Iterable[Wire], system: System
) -> Iterator[Problem]:
    """FMUs none of whose outputs reaches another FMU, though those of the block that they replace
    may: each with the ports by which the haptic loop knows the block (`rows`), and those of the
    FMU."""
    ends = {end for row in rows for end in (row.from_, row.to)}
    heard = {c.source for c in system.connections}
    for i, table in enumerate(scene.fmu):
        name = table.replaces or ""
        if table.engine or name not in blocks or name not in system.fmu or name in heard:
            continue
        block, scalars = blocks[name], system.fmu[name].description.scalars
        gives, takes = (
            [_port(v) for v in variables if f"{name}.{v.name}" in ends]
            for variables in (block.outputs, block.inputs)
        )
        if not gives:
            continue
        has = {
            kind: dict.fromkeys(s.port for s in scalars if s.causality == kind)
            for kind in ("output", "input")
        }
        message = (
            f"none of its outputs reaches another FMU, so that it is no {name}: that block gives "
            f"{_write_ports(gives)} and takes {_write_ports(takes)}; "
            f"the FMU has outputs {_write_ports(has['output'])} and inputs "
            f"{_write_ports(has['input'])}. Give it ports of these names, say what it calls them "
            "(map, --map), or lead a [[connection]] from it"
        )
        yield ("fmu", i, "replaces"), message


def _port(variable: Variable) -> str:
    size = ",".join(map(str, variable.shape))
    return f"{variable.name}[{size}]" if size else variable.name


def _write_ports(ports: Iterable[str]) -> str:
    names = [*ports]
    more = f" and {len(names) - MAX_PORTS} more" if len(names) > MAX_PORTS else ""
    return ", ".join(names[:MAX_PORTS]) + more if names else "none"
