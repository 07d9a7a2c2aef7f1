"""The operations of a plan. Each names what it works on; `run` binds it to buffers and calls."""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True)
class Get:
    """Read all outputs of an FMU; they are stamped with the event's tick."""

    fmu: str


@dataclass(frozen=True)
class Push:
    """Give a hold the newest sample of its source."""

    connection: str


@dataclass(frozen=True)
class Evaluate:
    """Ask a hold for the value of this tick."""

    connection: str


@dataclass(frozen=True)
class Set:
    """Write all connected inputs of an FMU."""

    fmu: str


@dataclass(frozen=True)
class Step:
    """fmi2DoStep from this tick over `dticks`."""

    fmu: str
    dticks: int


@dataclass(frozen=True)
class Record:
    """Write a row of a clock's results: the outputs of all its FMUs."""

    clock: str


@dataclass(frozen=True)
class StopWhen:
    """End the run in good order if the system's condition holds."""


Operation = Get | Push | Evaluate | Set | Step | Record | StopWhen
