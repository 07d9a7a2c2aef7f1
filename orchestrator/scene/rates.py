"""Rates and times of a scene, which may be written as exact fractions; and a recorded trace of
frames, `graphics.rate = { trace = "frames.csv" }`.

A trace has one time stamp (s) per line, increasing, in the first column of a CSV; a first line that
is no number is a header, and # starts a comment. Times count from the first stamp, at which the run
starts. The scene keeps the list of times instead of the file, so that run.json contains the frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path as FilePath
from typing import Annotated, Any

from pydantic import AfterValidator
from pydantic_core import PydanticCustomError

from hapticlink.components.specs.quantities import Elapsed, Quantity, Seed
from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import exact


@dataclass(frozen=True)
class Exact(Quantity):
    """A quantity that may also be written as text: a fraction of whole numbers or a decimal."""

    def __iter__(self) -> Iterator[Any]:
        yield AfterValidator(self._checked)

    def _checked(self, value: int | float | str) -> int | float | str:
        try:
            number = exact(value)
        except (ValueError, ZeroDivisionError):
            raise PydanticCustomError("no_number", "no number") from None
        if number not in self:
            raise PydanticCustomError("out_of_range", "out of range")
        return value


Rate = Annotated[int | float | str, Exact("Hz", gt=0, le=1000000)]
Seconds = Annotated[int | float | str, Exact("s", gt=0, le=100000)]


@dataclass(frozen=True, kw_only=True)
class VariableRate:
    """Periods drawn uniformly between 1/max and 1/min, in whole haptic ticks."""

    min: Rate
    """Lowest rate."""
    max: Rate
    """Highest rate."""
    seed: Seed = 0
    """Seed of the generator, numpy's PCG64."""


AnyRate = Rate | VariableRate | tuple[Elapsed, ...]
"""A rate (Hz), bounds of a varying rate, or the times (s) at which steps end; a recorded trace,
`{ trace = FILE }`, is read as such times."""

LARGEST = 2**24
"""Bytes: some 10^6 frames, 4 h of them at 60 Hz."""
MAX_STAMP = Decimal("1e12")
"""Largest time stamp (s); seconds since 1970 are about 2e9."""


@dataclass(frozen=True, kw_only=True)
class Trace:
    """A recorded trace of frame times, in place of a rate."""

    trace: str
    """A CSV file, relative to the scene's file, whose first column holds the times (s) at which
    frames ended."""


def read_frame_times(path: FilePath, start: float = 0.0) -> list[float]:
    """The ends of the frames (s), where the first stamp is at `start`. Raises InputFault, with the
    line, for a file that is no trace."""
    lines = text_files.read_text(path, "a trace of frames", LARGEST).splitlines()
    stamps: list[Decimal] = []
    for number, line in enumerate(lines, start=1):
        field = line.partition("#")[0].split(",")[0].strip()
        if not field:
            continue
        try:
            stamp = Decimal(field)
            if not -MAX_STAMP < stamp < MAX_STAMP:
                raise InvalidOperation
        except InvalidOperation:  # not a number, or a comparison with "nan"
            if number == 1:
                continue
            raise InputFault(f"{path}: line {number}: {field[:100]!r} is no time in s") from None
        if stamps and not stamp > stamps[-1]:
            raise InputFault(f"{path}: line {number}: {field[:100]} s is not after {stamps[-1]} s")
        stamps.append(stamp)
    if len(stamps) < 2:
        raise InputFault(f"{path}: {len(stamps)} time stamps; a trace of frames has at least 2")
    # Decimals subtract exactly: 1.7 - 1.6 is 0.1.
    return [float(stamp - stamps[0] + Decimal(repr(start))) for stamp in stamps[1:]]


def find_traces(data: Mapping[str, Any]) -> list[tuple[tuple[str | int, ...], dict[str, Any]]]:
    """The [graphics] and [[fmu]] tables with `rate = { trace = FILE }`, and their paths."""
    fmus = data.get("fmu")
    tables: list[tuple[tuple[str | int, ...], Any]] = [(("graphics",), data.get("graphics"))]
    tables += [(("fmu", i), f) for i, f in enumerate(fmus if isinstance(fmus, list) else ())]
    return [(path, t) for path, t in tables if isinstance(t, dict) and _is_trace(t.get("rate"))]


def _is_trace(rate: Any) -> bool:
    return isinstance(rate, dict) and rate.keys() == {"trace"} and isinstance(rate["trace"], str)
