"""What can go wrong, and the exit status of each: 1 the run failed, 2 bad input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class Fault(Exception):
    """A failure told to the user in one message, without a traceback."""

    exit_status = 1


class InputFault(Fault):
    """Something the user wrote cannot be used."""

    exit_status = 2


@dataclass(frozen=True)
class Finding:
    """One fault of a scene: where (dotted key), on which line or by which option, what."""

    key: str
    message: str
    line: int | None = None
    option: str | None = None

    def __str__(self) -> str:
        place = self.option or (f"line {self.line}" if self.line else "")
        return ": ".join(part for part in (place, self.key, self.message) if part)


def unplaced(path: Sequence[str | int], message: str) -> Finding:
    """A finding in a scene that no file wrote."""
    return Finding(".".join(map(str, path)), message)


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
    ) -> None:
        self.fmu, self.what, self.time, self.messages = fmu, what, time, tuple(messages)
        self.passing = passing
        said = "".join(f"\n  {fmu} says: {m}" for m in messages)
        super().__init__(f"{fmu}: {what} at t = {time!r} s{said}")


class Interrupted(Fault):
    """The user ended the run (Ctrl-C)."""

    def __init__(self, time: float) -> None:
        self.time = time
        super().__init__(f"interrupted at t = {time!r} s")
