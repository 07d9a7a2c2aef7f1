"""Operations of a run beside those of its plan: what the energy meters take of gets and sets."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from hapticlink.orchestrator.plan.operations import Get, Operation, Set
from hapticlink.orchestrator.run.concurrent_fmus import Collect
from hapticlink.orchestrator.run.energy.meters import Meters


@dataclass(frozen=True)
class Read:
    """Read all outputs of an FMU, which need not be finite, as those of an iteration."""

    fmu: str


@dataclass(frozen=True)
class Sample:
    """The meter of a connection takes a sample of its source, stamped `ahead` of the tick."""

    connection: str
    ahead: int


@dataclass(frozen=True)
class Move:
    """The meter of a connection takes the displacement of its target, `ahead` of the tick."""

    connection: str
    ahead: int


@dataclass(frozen=True)
class Feed:
    """The meter of a connection takes the effort that its target holds over a `share` of a step."""

    connection: str
    share: float


Metering = Read | Sample | Move | Feed


def metered(
    operations: Iterable[Operation | Collect], meters: Meters, judged: bool = True
) -> Iterator[Operation | Metering | Collect]:
    """The operations, each followed by what the meters take of it. Not `judged`, outputs that are
    not finite are accepted."""
    for operation in operations:
        match operation:
            case Get(fmu, ahead):
                yield operation if judged else Read(fmu)
                for connection in meters.of_source.get(fmu, ()):
                    yield Sample(connection, ahead)
                for connection in meters.of_target.get(fmu, ()):
                    yield Move(connection, ahead)
            case Set(fmu, now=False):
                yield operation
                for connection in meters.of_target.get(fmu, ()):
                    yield Feed(connection, meters.shares.get(fmu, 1.0))
            case _:
                yield operation
