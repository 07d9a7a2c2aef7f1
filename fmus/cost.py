"""Computational cost of a block: operations of its graphs, and signals at its ports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hapticlink.fmus.blocks import component


@dataclass(frozen=True)
class Cost:
    """Instructions of one communication step (all substeps) and of one evaluation of the outputs;
    sizes of the ports by name."""

    step: int
    output: int
    inputs: Mapping[str, int]
    outputs: Mapping[str, int]


def cost(name: str, settings: Mapping[str, Any]) -> Cost:
    """The cost of the block `name` with `settings`. Raises FmuError if they give no component."""
    made = component(name, settings)
    return Cost(
        step=made.step.n_instructions() * made.substeps,
        output=made.output.n_instructions(),
        inputs={v.name: v.size for v in made.inputs},
        outputs={v.name: v.size for v in made.outputs},
    )
