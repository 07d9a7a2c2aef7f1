"""The operations of a plan, as data; `run` binds them to buffers and calls."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple


class Firing(NamedTuple):
    """A clock starts a step of `dticks`; a `final` step would end after the end of the run."""

    clock: str
    dticks: int
    final: bool


class Event(NamedTuple):
    """The kind of an event: which clocks fire, and whether it is the `first` one, at t = 0."""

    first: bool
    firings: tuple[Firing, ...]


@dataclass(frozen=True)
class Get:
    """Read all outputs of an FMU; their stamp is `ahead` of the event's tick. Not `judged`, as
    within an iteration, they need be neither finite nor within their bounds."""

    fmu: str
    ahead: int = 0
    judged: bool = True


@dataclass(frozen=True)
class Push:
    """Push the newest sample of its source into a hold; its stamp is `ahead` of this tick."""

    connection: str
    ahead: int = 0


@dataclass(frozen=True)
class Evaluate:
    """Evaluate a hold from the samples known at this tick for the instant `ahead` of it: the middle
    of the step for a plant, 0 for a sampled block."""

    connection: str
    ahead: Fraction = Fraction(0)


@dataclass(frozen=True)
class Set:
    """Set all connected inputs of an FMU to their held values; with `now`, to the sources' newest
    outputs without holds."""

    fmu: str
    now: bool = False


@dataclass(frozen=True)
class Step:
    """fmi2DoStep from this tick over `dticks`, or over part `part` of `parts` of it."""

    fmu: str
    dticks: int
    part: int = 0
    parts: int = 1


@dataclass(frozen=True)
class Record:
    """Write a row of a clock's table: the outputs of all its FMUs."""

    clock: str


@dataclass(frozen=True)
class StopWhen:
    """End the run, without a fault, if the system's stop condition holds."""


@dataclass(frozen=True)
class Blend:
    """Evaluate a weighted sum of a hold's values, given by pairs (weight, `ahead` of this tick)."""

    connection: str
    points: tuple[tuple[float, Fraction], ...]


@dataclass(frozen=True)
class Save:
    """Save the state of an FMU (fmi2GetFMUstate)."""

    fmu: str


@dataclass(frozen=True)
class Rollback:
    """Restore the saved state of an FMU (fmi2SetFMUstate)."""

    fmu: str


@dataclass(frozen=True)
class Repeat:
    """Fixed-point iteration over one co-simulation step of `dticks`.

    guess: push trial outputs into the holds of `connections`. body: the step itself. again:
    restore the FMU states before a repetition. Ends when the outputs at the end of the step are
    those that were pushed.
    """

    connections: tuple[str, ...]
    dticks: int
    guess: tuple[Push, ...]
    body: tuple[Operation, ...]
    again: tuple[Operation, ...]


Operation = (
    Get | Push | Evaluate | Blend | Set | Step | Save | Rollback | Repeat | Record | StopWhen
)


def flat(block: Iterable[Operation]) -> Iterator[Operation]:
    """The operations of a block, those of a Repeat listed once."""
    for operation in block:
        if isinstance(operation, Repeat):
            yield from (*operation.guess, *flat(operation.body))
        else:
            yield operation
