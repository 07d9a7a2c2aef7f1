"""The messages of a run and a server of FMUs: MessagePack, one array a ZeroMQ message.

A request is [session, number, t_1, pending, call, arguments]: a session is 16 random bytes, numbers
count its calls from 0 on, `pending` are inputs to set before the call, each [setter, values], and
the calls are those of an isolated FMU (`fmi/worker.py`). The answer to it is
[number, t_1, t_2, t_3, kind, content]. Times are ns of the sender's clock; values are vectors of
IEEE 754 doubles in the order of their names, little endian. What has another form is refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgpack

MOST = 1 << 20
"""Largest message (bytes)."""
ARGUMENTS: Mapping[str, tuple[type, ...]] = {
    "hello": (str, list, dict),
    "connect": (list,),
    "enter_initialization": (float, float),
    "exit_initialization": (),
    "read": (),
    "step": (float, float, float),
    "save": (int,),
    "rollback": (int,),
    "close": (),
}
"""The calls with the types of their arguments."""
KINDS = ("answer", "fault", "end", "refused")
_REQUEST = (bytes, int, int, list, str, list)
_ANSWER = (int, int, int, int, str)


class Malformed(Exception):
    """A message that no run and no server sends; the text says why."""


class Message:
    """A record whose fields are sent in their order."""

    def packed(self) -> bytes:
        packed: bytes = msgpack.packb([*vars(self).values()])
        return packed


@dataclass(frozen=True)
class Request(Message):
    """A call of a session, its `number`-th, that was sent at `sent` (ns of the run's clock)."""

    session: bytes
    number: int
    sent: int
    pending: list[Any]
    call: str
    arguments: list[Any]


@dataclass(frozen=True)
class Answer(Message):
    """The answer to the call `number`, which was `sent` at t_1 of the run's clock, and `received`
    at t_2 and `answered` at t_3 of the server's (ns)."""

    number: int
    sent: int
    received: int
    answered: int
    kind: str
    content: Any


def request_of(message: bytes) -> Request:
    """The request in a message. Raises Malformed."""
    fields = _unpack(message)
    _require_types("request", fields, _REQUEST)
    request = Request(*fields)
    if request.call not in ARGUMENTS:
        raise Malformed(f"no call {request.call[:40]!r}")
    _require_types(request.call, request.arguments, ARGUMENTS[request.call])
    if len(request.session) != 16 or request.number < 0:
        raise Malformed("a session of 16 bytes and a number from 0 on")
    for each in request.pending:
        _require_types("input", each, (int, bytes))
    if not all(math.isfinite(a) for a in request.arguments if isinstance(a, float)):
        raise Malformed("times have to be finite")
    return request


def answer_of(message: bytes, call: str, outputs: int) -> Answer:
    """The answer in a message, to a call of an FMU with so many outputs. Raises Malformed."""
    fields = _unpack(message)
    if not isinstance(fields, list) or len(fields) != 6:
        raise Malformed("answer: six fields")
    _require_types("answer", fields[:5], _ANSWER)
    answer = Answer(*fields)
    if answer.kind not in KINDS:
        raise Malformed(f"no kind {answer.kind[:40]!r}")
    content, size = answer.content, 8 * outputs
    if answer.kind == "refused":
        fits = isinstance(content, str)
    elif answer.kind != "answer":
        fits = _is_fault(content)
    elif call == "step":
        form = isinstance(content, list) and len(content) == 4
        values, fault, *rest = content if form else (b"", 0)
        fits = tuple(map(type, rest)) == (bool, float) and type(values) is bytes
        fits &= len(values) == size if fault is None else _is_fault(fault)
    elif call == "read":
        fits = isinstance(content, bytes) and len(content) == size
    else:
        fits = call != "connect" or type(content) is int
    if not fits:
        raise Malformed(f"{call}: an answer of another form or size")
    return answer


def _is_fault(content: Any) -> bool:
    """What, when (s), messages, repeatable (`FmuFault`)."""
    types = (str, float, list, bool)
    form = isinstance(content, list) and tuple(map(type, content)) == types
    return form and all(isinstance(text, str) for text in content[2])


def _unpack(message: bytes) -> Any:
    try:
        return msgpack.unpackb(message)
    except (ValueError, TypeError, msgpack.UnpackException) as error:
        raise Malformed(f"no MessagePack: {error}") from None


def _require_types(what: str, fields: Any, types: tuple[type, ...]) -> None:
    if not isinstance(fields, list) or tuple(map(type, fields)) != types:
        wanted = ", ".join(kind.__name__ for kind in types)
        raise Malformed(f"{what}: ({wanted}) is asked for")
