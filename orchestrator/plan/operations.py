"""The operations of a plan, as data; `run` binds them to buffers and calls.

An operation is a class, in which everybody who reads plans finds what it is: its code in C with its
numbers (`run`), the stamps that it passes on (`sample_ages`), the signals between which it has
slopes (`analysis.stability`); its name, fields and `does` are what is printed (`explain`). A
further one that works on an FMU or a hold needs a class here, which `Operation` names, a number in
loop.h and a case in operations.c.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, NamedTuple

from hapticlink.orchestrator.scene.conditions import COMPARISONS
from hapticlink.orchestrator.system.read_beside import read_beside
from hapticlink.orchestrator.system.system import System


class Firing(NamedTuple):
    """A clock starts a step of `dticks`; a `final` step would end after the end of the run."""

    clock: str
    dticks: int
    final: bool


class Event(NamedTuple):
    """The kind of an event: which clocks fire, and whether it is the `first` one, at t = 0."""

    first: bool
    firings: tuple[Firing, ...]


Place = tuple[str, str]
"""Where a sample is: in the "outputs" of an FMU, in the "hold" of a connection, in its value that
is "held", or in the "input" of its target; "sources" are those outputs that a connection takes, and
"step" is the beginning of an FMU's newest step."""
Stamp = int | Place
"""The instant that a sample describes: so many ticks after the event, or that of what is in another
place."""


class SignalUse(NamedTuple):
    """The places in the signal vector that an operation reads and writes."""

    read: tuple[Place, ...] = ()
    written: tuple[Place, ...] = ()


class Instruction:
    """What is declared of every operation.

    does: what it does, in the legend of printed plans. code: its number in loop.h, PYTHON where it
    has none, with the reason `why_in_python`. b, x: the fields that are these numbers of its record
    there, if any. concurrent: whether FMUs in processes of their own may be stepping meanwhile.
    observes: whether it leaves FMUs, holds and signals as they are, and writes rows, measures, or
    ends the run.
    """

    does: ClassVar[str]
    code: ClassVar[str] = "PYTHON"
    b: ClassVar[str] = ""
    x: ClassVar[str] = ""
    why_in_python: ClassVar[str] = ""
    concurrent: ClassVar[bool] = False
    observes: ClassVar[bool] = False

    def numbers(self, system: System) -> dict[str, float]:
        """The numbers of its record beside the object that it works on, by their names there."""
        return {slot: getattr(self, name) for slot in "bx" if (name := getattr(self, slot))}

    def stamps(self, system: System) -> Iterator[tuple[Place, Stamp]]:
        """The places to which it brings samples, each with the stamp of these."""
        yield from ()

    def signals(self, system: System) -> SignalUse | None:
        """What it reads and writes beside its FMU or hold; None of what has no slopes."""
        return None


@dataclass(frozen=True)
class OfFmu(Instruction):
    """An operation of an FMU."""

    fmu: str


@dataclass(frozen=True)
class OfHold(Instruction):
    """An operation of the hold of a connection."""

    connection: str


@dataclass(frozen=True)
class Get(OfFmu):
    """Read all outputs of an FMU; their stamp is `ahead` of the event's tick. Not `judged`, as
    within an iteration, they need be neither finite nor within their bounds."""

    ahead: int = 0
    judged: bool = True
    does = "read an FMU's outputs"
    code, b = "GET", "judged"

    def stamps(self, system: System) -> Iterator[tuple[Place, Stamp]]:
        frames = system.fmu[self.fmu].frames
        yield ("outputs", self.fmu), ("step", self.fmu) if frames else self.ahead

    def signals(self, system: System) -> SignalUse:
        return SignalUse(written=(("outputs", self.fmu),))


@dataclass(frozen=True)
class Push(OfHold):
    """Push the newest sample of its source into a hold; its stamp is `ahead` of this tick."""

    ahead: int = 0
    does = "give a hold the newest sample"
    code, b = "PUSH", "ahead"

    def stamps(self, system: System) -> Iterator[tuple[Place, Stamp]]:
        source = system.connection[self.connection].source
        begun = 0 if system.fmu[source].frames else self.ahead
        yield ("hold", self.connection), begun if self.ahead else ("outputs", source)

    def signals(self, system: System) -> SignalUse:
        return SignalUse(read=(("sources", self.connection),))


@dataclass(frozen=True)
class _Evaluation(OfHold):
    """What gives the value of a hold."""

    concurrent = True

    def stamps(self, system: System) -> Iterator[tuple[Place, Stamp]]:
        yield ("held", self.connection), ("hold", self.connection)

    def signals(self, system: System) -> SignalUse:
        held = (("held", self.connection),)
        beside = read_beside(system.connection[self.connection], system)
        read = (("held" if row.held else "sources", row.of.name) for row in beside)
        return SignalUse((*held, *read), held)


@dataclass(frozen=True)
class Evaluate(_Evaluation):
    """Evaluate a hold from the samples known at this tick for the instant `ahead` of it: the middle
    of the step for a plant, 0 for a sampled block."""

    ahead: Fraction = Fraction(0)
    does = "ask a hold for its value"
    code, x = "EVALUATE", "ahead"


@dataclass(frozen=True)
class Blend(_Evaluation):
    """Evaluate a weighted sum of a hold's values, given by pairs (weight, `ahead` of this tick)."""

    points: tuple[tuple[float, Fraction], ...]
    does = "ask a hold for a weighted sum of its values"
    code = "BLEND"


@dataclass(frozen=True)
class Set(OfFmu):
    """Set all connected inputs of an FMU to their held values; with `now`, to the sources' newest
    outputs without holds."""

    now: bool = False
    does = "write an FMU's inputs"
    code = "SET"

    def stamps(self, system: System) -> Iterator[tuple[Place, Stamp]]:
        for c in system.into(self.fmu):
            held = c.hold and not self.now
            yield ("input", c.name), ("held", c.name) if held else ("outputs", c.source)

    def signals(self, system: System) -> SignalUse:
        into = system.into(self.fmu)
        sources = (("sources", c.name) for c in into)
        return SignalUse((*sources, *(("held", c.name) for c in into if c.hold)))


@dataclass(frozen=True)
class Step(OfFmu):
    """fmi2DoStep from this tick over `dticks`, or over part `part` of `parts` of it."""

    dticks: int
    part: int = 0
    parts: int = 1
    does = "an FMU's doStep, over `dticks` ticks"
    code = "STEP"

    def numbers(self, system: System) -> dict[str, float]:
        size = float(self.dticks * (system.timeline.base / self.parts))
        over = 0 if system.fmu[self.fmu].sampled and self.parts == 1 else self.dticks
        return {"b": self.part * self.dticks, "c": self.parts, "d": over, "x": size}

    def stamps(self, system: System) -> Iterator[tuple[Place, Stamp]]:
        if not self.part:
            yield ("step", self.fmu), 0

    def signals(self, system: System) -> SignalUse:
        return SignalUse()


@dataclass(frozen=True)
class Record(Instruction):
    """Write a row of a table, of a clock's: outputs of all its FMUs."""

    table: str
    does = "write a row of a rate's table"
    code = "RECORD"
    observes = True


@dataclass(frozen=True)
class StopWhen(Instruction):
    """End the run, without a fault, if the system's stop condition holds."""

    does = "end the run where its stop condition holds"
    code = "STOP_WHEN"
    observes = True

    def numbers(self, system: System) -> dict[str, float]:
        assert system.ends_when
        comparison = [*COMPARISONS].index(system.ends_when.comparison)
        return {"b": comparison, "x": system.ends_when.value}


_REPEATED = "Python repeats steps, whose operations are in C"


@dataclass(frozen=True)
class Save(OfFmu):
    """Save the state of an FMU (fmi2GetFMUstate)."""

    does = "save an FMU's state"
    why_in_python = _REPEATED


@dataclass(frozen=True)
class Rollback(OfFmu):
    """Restore the saved state of an FMU (fmi2SetFMUstate)."""

    does = "restore the saved state"
    why_in_python = _REPEATED


@dataclass(frozen=True)
class Repeat(Instruction):
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
    does = "repeat a step until what its connections pass on agrees"
    why_in_python = _REPEATED


Operation = (
    Get | Push | Evaluate | Blend | Set | Step | Save | Rollback | Repeat | Record | StopWhen
)
"""Those that a coupling scheme may give."""


def flat(block: Iterable[Operation]) -> Iterator[Operation]:
    """The operations of a block, those of a Repeat listed once."""
    for operation in block:
        if isinstance(operation, Repeat):
            yield from (*operation.guess, *flat(operation.body))
        else:
            yield operation
