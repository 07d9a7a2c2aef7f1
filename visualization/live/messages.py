"""What a page may say, as JSON; anything else is refused as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import ConfigDict, Discriminator, Field, TypeAdapter, ValidationError

STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Place = Annotated[Number, Field(ge=-1e3, le=1e3)]
Name = Annotated[str, Field(max_length=200)]
MOST = 4096
"""Bytes of a message."""


@dataclass(frozen=True)
class Hand:
    """The hand pulls to `at` (x, y m), or has let go; user: the point that it holds, "" for the
    first user's."""

    __pydantic_config__ = STRICT
    type: Literal["hand"]
    at: tuple[Place, Place] | None
    user: Name = ""


@dataclass(frozen=True)
class Rate:
    """The graphics rate (Hz)."""

    __pydantic_config__ = STRICT
    type: Literal["rate"]
    value: Annotated[Number, Field(ge=0.01, le=1e4)]


@dataclass(frozen=True)
class Jitter:
    """Share of the graphics period by which each may be shorter or longer."""

    __pydantic_config__ = STRICT
    type: Literal["jitter"]
    value: Annotated[Number, Field(ge=0, le=0.9)]


@dataclass(frozen=True)
class Hold:
    """Another hold of a connection."""

    __pydantic_config__ = STRICT
    type: Literal["hold"]
    connection: Name
    hold: Name


@dataclass(frozen=True)
class Delay:
    """The latency (s) of a connection."""

    __pydantic_config__ = STRICT
    type: Literal["delay"]
    connection: Name
    value: Annotated[Number, Field(ge=0, le=1)]


@dataclass(frozen=True)
class Gain:
    """A parameter as a multiple of its value in the scene."""

    __pydantic_config__ = STRICT
    type: Literal["gain"]
    name: Name
    factor: Annotated[Number, Field(ge=0, le=100)]


@dataclass(frozen=True)
class Topology:
    """The topology controller, on or off."""

    __pydantic_config__ = STRICT
    type: Literal["topology"]
    on: bool


@dataclass(frozen=True)
class Time:
    """What becomes of time; record: begin anew with a recording, or end it."""

    __pydantic_config__ = STRICT
    type: Literal["time"]
    do: Literal["pause", "resume", "step", "reset", "record"]


Message = Hand | Rate | Jitter | Hold | Delay | Gain | Topology | Time
OF = ("user", "connection", "name")
"""What tells messages of a type apart."""
_ADAPTER: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Discriminator("type")])


def newest(received: Sequence[Message]) -> list[Message]:
    """The messages without those that a later one undoes: the newest of each control and user."""
    kept: dict[object, Message] = {}
    for i, message in enumerate(received):
        of = next((v for k in OF if (v := getattr(message, k, None)) is not None), "")
        key: object = i if isinstance(message, Time) else (message.type, of)
        kept.pop(key, None)
        kept[key] = message
    return [*kept.values()]


def parse(text: str | bytes) -> Message:
    """The message of a page. Raises ValueError, which says what is wrong."""
    if isinstance(text, bytes):
        raise ValueError("a message is text")
    if len(text) > MOST:
        raise ValueError(f"a message has at most {MOST} characters")
    try:
        return _ADAPTER.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"{place or 'message'}: {first['msg']}") from None
