"""Consecutive doSteps of isolated FMUs run concurrently; any other operation is a barrier.

Steps are started and awaited in the plan's order, so results and faults are those of sequential
execution.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass

from hapticlink.orchestrator.plan.operations import Blend, Evaluate, Operation, Set, Step
from hapticlink.orchestrator.run.concurrent_fmus import Collect
from hapticlink.orchestrator.run.metered_operations import Feed, Metering


@dataclass(frozen=True)
class Finish:
    """Wait until the steps of isolated FMUs have been taken."""

    fmus: tuple[str, ...]


def with_barriers(
    operations: Iterable[Operation | Metering | Collect], isolated: Container[str]
) -> Iterator[Operation | Metering | Finish | Collect]:
    """The operations of a block, with a barrier after each group of concurrent steps."""
    stepping: list[str] = []
    for operation in operations:
        match operation:
            case Evaluate() | Blend() | Feed():
                pass
            case Set(fmu) | Step(fmu) if fmu in isolated and fmu not in stepping:
                pass
            case _ if stepping:
                yield Finish(tuple(stepping))
                stepping.clear()
        yield operation
        if isinstance(operation, Step) and operation.fmu in isolated:
            stepping.append(operation.fmu)
    if stepping:
        yield Finish(tuple(stepping))
