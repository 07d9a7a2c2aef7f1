"""The file of a run's state: a line that says what it is, the SHA-256 of the rest, and the rest as
JSON, in which arrays and bytes are base64."""

from __future__ import annotations

import base64
import hashlib
import json
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault, shorten
from hapticlink.orchestrator.results.write_files import write_atomically

SUFFIX = ".state"
"""Of a state, by which it is known among scenes."""
_FIRST = "state of a run of hapticlink"
LARGEST = 1 << 31
"""Bytes."""
_MISREAD = (
    LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError,
    AssertionError,
)  # fmt: skip


def write_state(path: Path, content: Mapping[str, Any]) -> None:
    """Writes a state atomically. Raises InputFault for a value that is no plain data, with its
    type."""
    body = json.dumps(_encoded(content))
    write_atomically(path, f"{_FIRST}\n{_checksum(body)}\n{body}".encode())


def read_state(path: Path) -> dict[str, Any]:
    """The content of the file. Raises InputFault where it is no state or is damaged."""
    # Any byte is a character of Latin-1: what is damaged is told by the checksum.
    text = text_files.read_text(path, "a state", LARGEST, "latin-1")
    first, _, rest = text.partition("\n")
    if first != _FIRST:
        raise InputFault(f"{path}: no state of a run: give a file that `run --save` wrote")
    checksum, _, body = rest.partition("\n")
    if _checksum(body) != checksum:
        raise InputFault(f"{path}: damaged, its checksum is another: save the state again")
    with expect_state(path):
        content: dict[str, Any] = {**_decoded(json.loads(body))}
    return content


@contextmanager
def expect_state(path: Path) -> Iterator[None]:
    """Content of a state with which its reader can do nothing raises InputFault: whoever changed it
    has made its checksum anew."""
    try:
        yield
    except _MISREAD as error:
        raise InputFault(
            f"{path}: changed since it was saved, as its checksum was ({type(error).__name__}: "
            f"{shorten(str(error))}): save the state again"
        ) from error


def _checksum(body: str) -> str:
    return hashlib.sha256(body.encode()).hexdigest()


def _encoded(value: Any) -> Any:
    match value:
        case None | bool() | str() | int() | float():
            return value
        case np.generic():
            return value.item()
        case np.ndarray() if value.dtype.kind in "biuf":
            data = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode()
            return {"array": [value.dtype.str, value.shape, data]}
        case bytes():
            return {"bytes": base64.b64encode(value).decode()}
        case list():
            return [_encoded(each) for each in value]
        case tuple():
            return {"tuple": [_encoded(each) for each in value]}
        case deque():
            return {"deque": [[_encoded(each) for each in value], value.maxlen]}
        case Mapping():
            return {"table": [[_encoded(k), _encoded(v)] for k, v in value.items()]}
    raise InputFault(
        f"{type(value).__name__}: cannot be saved: numbers, texts, arrays of numbers, and lists "
        "and tables of these can"
    )


def _decoded(value: Any) -> Any:
    match value:
        case list():
            return [_decoded(each) for each in value]
        case {"array": [str(dtype), list(shape), str(data)]}:
            flat = np.frombuffer(base64.b64decode(data), np.dtype(dtype))
            return flat.reshape(shape).copy()
        case {"bytes": str(data)}:
            return base64.b64decode(data)
        case {"tuple": list(entries)}:
            return tuple(_decoded(each) for each in entries)
        case {"deque": [list(entries), most]}:
            return deque((_decoded(each) for each in entries), most)
        case {"table": list(rows)}:
            return {_decoded(key): _decoded(each) for key, each in rows}
    return value
