"""What can go wrong, and the exit status of each: 1 the run failed, 2 bad input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hapticlink.components.registry import near as near  # told here too
from hapticlink.components.registry import unknown as unknown


class Fault(Exception):
    """A failure told to the user in one message, without a traceback.

    repeatable: the scene gives it again, anywhere and at any time; others come from the machine, as
    a full disk or a process that was killed."""

    exit_status = 1
    repeatable = False


class InputFault(Fault):
    """Something the user wrote cannot be used."""

    exit_status = 2
    repeatable = True


@dataclass(frozen=True)
class Finding:
    """One fault of a scene: where (dotted key), on which line or by which option, what. `file` is
    that of a scene which this one extends."""

    key: str
    message: str
    line: int | None = None
    option: str | None = None
    file: str = ""

    def __str__(self) -> str:
        line = f"line {self.line}" if self.line else ""
        place = self.option or ", ".join(part for part in (self.file, line) if part)
        return ": ".join(part for part in (place, self.key, self.message) if part)


class SceneFault(InputFault):
    """A scene that is refused, with all its findings."""

    def __init__(self, scene: str, findings: Sequence[Finding]) -> None:
        self.findings = tuple(findings)
        count = f"{len(findings)} fault" + ("s" if len(findings) > 1 else "")
        super().__init__("\n".join([f"{scene}: {count}", *(f"  {f}" for f in findings)]))


class FmuFault(Fault):
    """An FMU call that failed or a value that cannot be used; names FMU, call and time.

    passing: a smaller step from the state before may do (a step that failed without harm to the
    FMU, FMI 2.0.5 section 4.2.2; an output that is not finite)."""

    def __init__(
        self,
        fmu: str,
        what: str,
        time: float,
        messages: Sequence[str] = (),
        passing: bool = False,
        repeatable: bool = False,
    ) -> None:
        self.fmu, self.what, self.time, self.messages = fmu, what, time, tuple(messages)
        self.passing, self.repeatable = passing, repeatable
        said = "".join(f"\n  {fmu} says: {m}" for m in messages)
        super().__init__(f"{fmu}: {what} at t = {time:.6g} s{said}")


class Diverged(FmuFault):
    """A run that has left physics, though its numbers are finite."""


class AsksToEnd(FmuFault):
    """An FMU that asks to end the simulation within a step; nothing is wrong."""


class Interrupted(Fault):
    """The user ended the run (Ctrl-C), at a time (s) or before it began."""

    def __init__(self, time: float | None = None) -> None:
        self.time = time
        when = "before the run" if time is None else f"at t = {time:.6g} s"
        super().__init__(f"interrupted {when}")
