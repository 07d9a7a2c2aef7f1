"""A scheme orders the operations of an event. One scheme a file.

All keep to FMI 2.0.5 section 4.2.4: no get after a set without a doStep between.
"""

from __future__ import annotations

from collections.abc import Callable

from hapticlink.orchestrator.plan.operations import Event, Operation
from hapticlink.orchestrator.plan.schemes import gauss_seidel, gauss_seidel_plants, iterated, jacobi
from hapticlink.orchestrator.system.system import System

SCHEMES: dict[str, Callable[[System, Event], tuple[Operation, ...]]] = {
    "gauss-seidel": gauss_seidel.block,
    "jacobi": jacobi.block,
    "gauss-seidel-plants": gauss_seidel_plants.block,
    "iterated": iterated.block,
}
CAUSAL = frozenset({"gauss-seidel", "jacobi"})
"""Schemes in which nobody reads a value stamped later than the start of its step."""
