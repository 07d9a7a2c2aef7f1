"""Coupling schemes, one a file: they order the operations of an event.

All conform to FMI 2.0.5 section 4.2.4: no get after a set without a doStep between.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hapticlink.components.registry import Registry, no_instance
from hapticlink.orchestrator.plan.operations import Event, Operation
from hapticlink.orchestrator.plan.schemes import gauss_seidel, gauss_seidel_plants, iterated, jacobi
from hapticlink.orchestrator.scene import scene_tables
from hapticlink.orchestrator.system.system import Fmu, System


@dataclass(frozen=True)
class Scheme:
    """A coupling scheme. block: the operations of an event, in order. ordered: the groups of FMUs
    that the scheme puts in an order by their dependencies, for the report of loops; none by
    default. Whether a scheme is causal is derived from its blocks (`sample_ages`)."""

    block: Callable[[System, Event], tuple[Operation, ...]]
    ordered: Callable[[System], list[list[Fmu]]] = lambda system: []


SCHEMES: Registry[Scheme] = scene_tables.SCHEMES
SCHEMES.misfit = lambda part: no_instance(part, Scheme)
SCHEMES |= {
    "gauss-seidel": Scheme(gauss_seidel.block, gauss_seidel.order_fmus),
    "jacobi": Scheme(jacobi.block),
    "gauss-seidel-plants": Scheme(gauss_seidel_plants.block, gauss_seidel_plants.order_fmus),
    "iterated": Scheme(iterated.block, iterated.order_fmus),
}
