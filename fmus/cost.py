"""What a block costs: operations of its graphs, and the signals at its ports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hapticlink.fmus.blocks import component


@dataclass(frozen=True)
class Cost:
    """Instructions of one communication step (all substeps) and of one reading of the outputs;
    sizes of the ports by name."""

    step: int
    output: int
    inputs: Mapping[str, int]
    outputs: Mapping[str, int]


def cost(name: str, settings: Mapping[str, Any], step_size: float) -> Cost:
    """Of the block `name` of `settings`. Raises FmuError where they give no component."""
    made = component(name, settings, step_size)
    return Cost(
        step=made.step.n_instructions() * made.substeps,
        output=made.output.n_instructions(),
        inputs={v.name: v.size for v in made.inputs},
        outputs={v.name: v.size for v in made.outputs},
    )
