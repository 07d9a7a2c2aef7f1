"""Exceptions that are reported to the user, with exit status: 1 the run failed, 2 bad input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hapticlink.components.registry import near as near  # re-exported
from hapticlink.components.registry import unknown as unknown

SHOWN, COUNTED = 20, 1000
"""Findings of a scene that are shown, and that are looked for."""


def shorten(text: str, most: int = 100) -> str:
    """What somebody wrote, as much of it as makes it known again."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def describe_os_error(error: OSError, place: object) -> str:
    """The file, or `place` where the system names none, and what is wrong there."""
    return f"{error.filename or place}: {error.strerror or error}"


def describe_memory_error(error: MemoryError) -> str:
    """What was to be allocated, where that is told, and a remedy."""
    what = f" ({error})" if str(error) else ""
    return (
        f"there is not enough memory{what}: end other applications, or take a shorter duration, a "
        "smaller scene, or fewer outputs ([record])"
    )


class Fault(Exception):
    """A failure that is reported in one message, without a traceback.

    repeatable: whether the same scene always fails with it; other faults come from the machine,
    such as a full disk or a killed process.
    """

    exit_status = 1
    repeatable = False


class InputFault(Fault):
    """Invalid input: something that the user wrote cannot be used."""

    exit_status = 2
    repeatable = True


@dataclass(frozen=True)
class Finding:
    """One fault of a scene: dotted key, message, and the line or the option where it was written.
    `file` is set for a key of a scene that this one extends."""

    key: str
    message: str
    line: int | None = None
    option: str | None = None
    file: str = ""

    def __str__(self) -> str:
        line = f"line {self.line}" if self.line else ""
        place = ", ".join(part for part in (self.file, line) if part)
        place = shorten(self.option) if self.option else place
        message = shorten(self.message, 1000)
        return ": ".join(part for part in (place, shorten(self.key), message) if part)


class SceneFault(InputFault):
    """An invalid scene, with its findings; the message shows the first SHOWN of them."""

    def __init__(self, scene: str, findings: Sequence[Finding]) -> None:
        self.findings = tuple(findings)
        count = f"{len(findings)} fault" + ("s" if len(findings) > 1 else "")
        more = " or more" if len(findings) >= COUNTED else ""
        lines = [f"{scene}: {count}{more}", *(f"  {f}" for f in findings[:SHOWN])]
        if len(findings) > SHOWN:
            lines.append(f"  and {len(findings) - SHOWN}{more or ' more'}, left out here")
        super().__init__("\n".join(lines))


class FmuFault(Fault):
    """A failed FMU call, or a value that cannot be used; names FMU, call and time."""

    def __init__(
        self,
        fmu: str,
        what: str,
        time: float,
        messages: Sequence[str] = (),
        repeatable: bool = False,
    ) -> None:
        self.fmu, self.what, self.time, self.messages = fmu, what, time, tuple(messages)
        self.repeatable = repeatable
        logged = "".join(f"\n  {fmu} says: {m}" for m in messages)
        super().__init__(f"{fmu}: {what} at t = {time:.6g} s{logged}")


class Diverged(FmuFault):
    """A run that has diverged to values without physical meaning, though they are still finite."""


class AsksToEnd(FmuFault):
    """An FMU requests the end of the simulation within a step; this is no error."""


class Interrupted(KeyboardInterrupt):
    """The user ended the work (Ctrl-C), `when`, or a run at a time (s). No Exception, so that no
    `except Exception` of a caller goes on after it."""

    exit_status = 1
    repeatable = False

    def __init__(self, time: float | None = None, when: str = "") -> None:
        self.time = time
        when = when if time is None else f"at t = {time:.6g} s"
        super().__init__(f"interrupted {when}".strip())
