"""The messages that a page may send, as JSON; anything else is refused as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, cast

from pydantic import ConfigDict, Discriminator, Field, ValidationError

from hapticlink.orchestrator.base.type_adapters import adapter
from hapticlink.visualization.live_and_standalone.offered_controls import (
    MODEL,
    RANGES,
    RENDERED,
)

STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Coordinate = Annotated[Number, Field(ge=-1e3, le=1e3)]
Name = Annotated[str, Field(max_length=200)]
MAX_CHARACTERS = 4096
"""Of a message."""


@dataclass(frozen=True)
class Hand:
    """The mouse pulls a handle, or releases it."""

    __pydantic_config__ = STRICT
    type: Literal["hand"]
    at: tuple[Coordinate, Coordinate] | tuple[Coordinate, Coordinate, Coordinate] | None
    """Where it pulls to, (x, y) in m, of a linkage in space (x, y, z); None where it releases the
    handle."""
    user: Name = ""
    """The point whose handle it is, "" for that of the first user."""


@dataclass(frozen=True)
class SetControl:
    """A control of the run, or of the second of two (`b`), is given a value."""

    __pydantic_config__ = STRICT
    type: Literal["set"]
    key: Name
    """As in `offered_controls`."""
    value: Number | bool | Name
    b: bool = False

    def __post_init__(self) -> None:
        kind, value = self.key.partition(".")[0], self.value
        if kind in RANGES:
            low, high = RANGES[kind]
            if not (isinstance(value, float) and low <= value <= high):
                raise ValueError(f"{self.key} = {value!r}: give a number from {low:g} to {high:g}")
        elif not isinstance(value, bool if self.key in (RENDERED, MODEL) else str):
            raise ValueError(f"{self.key} = {value!r}: is of another type")


@dataclass(frozen=True)
class Time:
    """A button: pause, resume, step by one haptic tick, begin anew at t = 0 (reset), or begin anew
    with a recording, or end it (record)."""

    __pydantic_config__ = STRICT
    type: Literal["time"]
    do: Literal["pause", "resume", "step", "reset", "record"]


@dataclass(frozen=True)
class Compare:
    """A second run beside the first, under the same hands, which begins with the settings of the
    first; or the first alone again."""

    __pydantic_config__ = STRICT
    type: Literal["compare"]
    on: bool


@dataclass(frozen=True)
class TrialReply:
    """An answer to the question of that number of a trial."""

    __pydantic_config__ = STRICT
    type: Literal["answer"]
    question: int
    given: Name


Message = Annotated[Hand | SetControl | Time | Compare | TrialReply, Discriminator("type")]


def newest(received: Sequence[Message]) -> list[Message]:
    """The messages without those that a later one replaces: the newest of each control and user."""
    by_control: dict[object, Message] = {}
    for i, message in enumerate(received):
        of = getattr(message, "key", getattr(message, "user", ""))
        key: object = i if isinstance(message, Time) else (message.type, of)
        by_control.pop(key, None)
        by_control[key] = message
    return [*by_control.values()]


def parse(text: str | bytes) -> Message:
    """Parse the message of a page. Raises ValueError, with the place and kind of the mistake."""
    if isinstance(text, bytes):
        raise ValueError("a message is text")
    if len(text) > MAX_CHARACTERS:
        raise ValueError(f"a message has at most {MAX_CHARACTERS} characters")
    try:
        return cast(Message, adapter(Message).validate_json(text))
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"{place or 'message'}: {first['msg']}") from None
