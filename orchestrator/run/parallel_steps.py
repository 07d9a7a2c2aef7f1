"""Steps of isolated FMUs that follow one another in a block run at the same time.

Each of a round is started in turn; where the plan wants anything else than to start the next one,
all are waited for, in their order. So what a run does, and the fault that it tells, are those of
one step after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from hapticlink.orchestrator.fmi.isolated import Isolated
from hapticlink.orchestrator.plan.operations import Blend, Evaluate, Operation, Set, Step

Call = Callable[[int], object]


def bound(
    operations: Iterable[Operation],
    bind: Callable[[Operation], Call],
    isolated: Mapping[str, Isolated],
) -> list[Call]:
    """The calls of a block's operations, with a wait where a round ends."""
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


def _finish(instances: list[Isolated]) -> Call:
    def finish(tick: int) -> None:
        for instance in instances:
            instance.finish()

    return finish
