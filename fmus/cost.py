"""Computational cost of a block: operations of its graphs, and signals at its ports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hapticlink.fmus.blocks import component
from hapticlink.fmus.fmu_functions import one_pass


@dataclass(frozen=True)
class Cost:
    """Instructions of one communication step, all substeps and the outputs, and without outputs on
    request; sizes of the ports by name, and the names of these outputs."""

    step: int
    reduced: int
    on_request: frozenset[str]
    inputs: Mapping[str, int]
    outputs: Mapping[str, int]


def cost(name: str, settings: Mapping[str, Any]) -> Cost:
    """The cost of the block `name` with `settings`. Raises FmuError if they give no component."""
    block = component(name, settings)
    parts = one_pass(block)
    before = (parts.substeps - 1) * parts.substep.n_instructions()
    return Cost(
        step=before + parts.advance.n_instructions(),
        reduced=before + (parts.reduced or parts.advance).n_instructions(),
        on_request=frozenset(v.name for v in block.outputs if v.on_request),
        inputs={v.name: v.size for v in block.inputs},
        outputs={v.name: v.size for v in block.outputs},
    )
