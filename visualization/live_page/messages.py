"""The messages that a page may send, as JSON; anything else is refused as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import ConfigDict, Discriminator, Field, TypeAdapter, ValidationError

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
    at: tuple[Coordinate, Coordinate] | None
    """Where it pulls to, (x, y) in m; None where it releases the handle."""
    user: Name = ""
    """The point whose handle it is, "" for that of the first user."""


@dataclass(frozen=True, kw_only=True)
class Change:
    """A change of the run, or of the second of two (`b`)."""

    __pydantic_config__ = STRICT
    b: bool = False


@dataclass(frozen=True)
class Rate(Change):
    """The graphics rate (Hz)."""

    type: Literal["rate"]
    value: Annotated[Number, Field(ge=0.01, le=1e4)]


@dataclass(frozen=True)
class Jitter(Change):
    """Share of the graphics period by which each may be shorter or longer."""

    type: Literal["jitter"]
    value: Annotated[Number, Field(ge=0, le=0.9)]


@dataclass(frozen=True)
class Hold(Change):
    """Another hold of a connection."""

    type: Literal["hold"]
    connection: Name
    hold: Name


@dataclass(frozen=True)
class Delay(Change):
    """The latency (s) of a connection."""

    type: Literal["delay"]
    connection: Name
    value: Annotated[Number, Field(ge=0, le=1)]


@dataclass(frozen=True)
class Gain(Change):
    """A parameter as a multiple of its value in the scene."""

    type: Literal["gain"]
    name: Name
    factor: Annotated[Number, Field(ge=0, le=100)]


@dataclass(frozen=True)
class Topology(Change):
    """The topology controller, on or off."""

    type: Literal["topology"]
    on: bool


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


Message = Hand | Rate | Jitter | Hold | Delay | Gain | Topology | Time | Compare
ADDRESSES = ("user", "connection", "name")
"""Fields that name what a message of its type is about."""
_ADAPTER: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Discriminator("type")])


def newest(received: Sequence[Message]) -> list[Message]:
    """The messages without those that a later one replaces: the newest of each control and user."""
    by_control: dict[object, Message] = {}
    for i, message in enumerate(received):
        of = next((v for k in ADDRESSES if (v := getattr(message, k, None)) is not None), "")
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
        return _ADAPTER.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"{place or 'message'}: {first['msg']}") from None
