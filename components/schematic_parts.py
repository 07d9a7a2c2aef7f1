"""The parts that a block is made of, as a schematic draws them.

A part is declared in the branch that adds its equations, so that a block has no part without them.
What parts read and give are names: of inputs, parameters, states and outputs of the block, and of
signals between parts.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class BlockPart:
    """A part of a block: its equation, and the signals that it reads and gives."""

    name: str
    equation: str
    """In Matplotlib's mathematical notation, between dollar signs; a line or more."""
    source: str = ""
    """Equation, section or figure of the report, or another source."""
    reads: tuple[str, ...] = ()
    gives: tuple[str, ...] = ()
    """Of a state: its value after the step."""


def require_complete(
    parts: Iterable[BlockPart],
    given: Collection[str],
    states: Collection[str],
    outputs: Collection[str],
) -> None:
    """Raises ValueError where the `parts` of a block read a signal that is neither `given` (its
    inputs, parameters and states) nor given by a part, where two parts give the same one, and where
    no part gives one of its states or outputs."""
    gives = [name for part in parts for name in part.gives]
    for part in parts:
        if unknown := [name for name in part.reads if name not in given and name not in gives]:
            raise ValueError(f"part `{part.name}` reads {unknown}, which the block does not have")
    if twice := sorted({name for name in gives if gives.count(name) > 1}):
        raise ValueError(f"parts: {twice} are given twice")
    if missing := [name for name in (*states, *outputs) if name not in gives]:
        raise ValueError(f"parts: no part gives {missing}")
