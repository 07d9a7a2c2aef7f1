"""The operations of a plan. Each names what it works on; `run` binds it to buffers and calls."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple


class Firing(NamedTuple):
    """A clock starts a step of `dticks`; a `final` one would end after the end of the run."""

    clock: str
    dticks: int
    final: bool


class Event(NamedTuple):
    """The kind of an instant: at `first` nothing has been stepped yet."""

    first: bool
    firings: tuple[Firing, ...]


class Part(NamedTuple):
    """A step of the plants of a clock by themselves, or the reading at its end."""

    clock: str
    dticks: int
    ended: bool = False


@dataclass(frozen=True)
class Get:
    """Read all outputs of an FMU; they are stamped `ahead` of the event's tick."""

    fmu: str
    ahead: int = 0


@dataclass(frozen=True)
class Push:
    """Give a hold the newest sample of its source, stamped `ahead` of this tick."""

    connection: str
    ahead: int = 0


@dataclass(frozen=True)
class Evaluate:
    """Evaluate a hold from the samples known at this tick for the instant `ahead` of it: the middle
    of the step for a plant, 0 for a sampled block.

    A plant that takes inputs that vary gets the value at the beginning of its step of `width`, and
    its derivatives up to `order`."""

    connection: str
    ahead: Fraction = Fraction(0)
    order: int = 0
    width: Fraction = Fraction(0)


@dataclass(frozen=True)
class Set:
    """Write all connected inputs of an FMU; `now` with the sources' newest outputs, no holds;
    with the `derivatives` that were evaluated."""

    fmu: str
    now: bool = False
    derivatives: bool = False


@dataclass(frozen=True)
class Step:
    """fmi2DoStep from this tick over `dticks`, or over part `part` of `parts` of it."""

    fmu: str
    dticks: int
    part: int = 0
    parts: int = 1


@dataclass(frozen=True)
class Record:
    """Write a row of a clock's results: the outputs of all its FMUs."""

    clock: str


@dataclass(frozen=True)
class StopWhen:
    """End the run in good order if the system's condition holds."""


@dataclass(frozen=True)
class Blend:
    """Evaluate a weighted sum of a hold's values: each (weight, `ahead` of this tick)."""

    connection: str
    points: tuple[tuple[float, Fraction], ...]


@dataclass(frozen=True)
class Save:
    """Keep the state of an FMU (fmi2GetFMUstate)."""

    fmu: str


@dataclass(frozen=True)
class Rollback:
    """Take an FMU back to the state that was saved (fmi2SetFMUstate)."""

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


@dataclass(frozen=True)
class Advance:
    """Take the plants of a clock over `dticks` in steps that the step control chooses."""

    clock: str
    dticks: int


Operation = (
    Get
    | Push
    | Evaluate
    | Blend
    | Set
    | Step
    | Save
    | Rollback
    | Repeat
    | Advance
    | Record
    | StopWhen
)


def flat(block: Iterable[Operation]) -> Iterator[Operation]:
    """The operations of a block, a repetition carried out once."""
    for operation in block:
        if isinstance(operation, Repeat):
            yield from (*operation.guess, *flat(operation.body))
        else:
            yield operation
