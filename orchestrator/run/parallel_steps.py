"""Consecutive doSteps of isolated FMUs run concurrently; any other operation is a barrier.

Steps are started and awaited in the plan's order, so results and faults are those of sequential
execution.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.plan.operations import Blend, Evaluate, Operation, Set, Step

Call = Callable[[int], object]


def bound(
    operations: Iterable[Operation],
    bind: Callable[[Operation], Call],
    isolated: Mapping[str, Instance],
) -> list[Call]:
    """The calls of a block's operations, with a barrier after each group of concurrent steps."""
    calls: list[Call] = []
    stepping: list[str] = []

    def wait() -> None:
        if stepping:
            calls.append(_finish([isolated[n] for n in stepping]))
            stepping.clear()

    for operation in operations:
        match operation:
            case Evaluate() | Blend():
                pass
            case Set(fmu) | Step(fmu) if fmu in isolated and fmu not in stepping:
                pass
            case _:
                wait()
        calls.append(bind(operation))
        if isinstance(operation, Step) and operation.fmu in isolated:
            stepping.append(operation.fmu)
    wait()
    return calls


def _finish(instances: list[Instance]) -> Call:
    def finish(tick: int) -> None:
        for instance in instances:
            instance.finish()

    return finish
