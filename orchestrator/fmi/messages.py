"""The most recent log messages of each FMU, by the key of its instance."""

from __future__ import annotations

from collections import deque
from itertools import count

from fmpy import fmi2

MAX_MESSAGES, MAX_LENGTH = 5, 2000
"""Messages of an instance, and characters of one."""

_messages: dict[int, deque[str]] = {}
_keys = count(1)


def open_log() -> int:
    """A key for a new instance; its messages are kept from now on."""
    key = next(_keys)
    _messages[key] = deque(maxlen=MAX_MESSAGES)
    return key


def keep_message(key: int, status: int, message: bytes) -> None:
    """Keep a message of instance `key`, to be shown if a call fails."""
    own = _messages.get(key)
    if own is not None and status != 0:
        text = (message or b"")[: 4 * MAX_LENGTH].decode("utf-8", "replace")
        own.append(text.strip()[:MAX_LENGTH])


def newest_messages(key: int) -> list[str]:
    return [*_messages.get(key, ())]


def close_log(key: int) -> None:
    _messages.pop(key, None)


def callbacks(key: int) -> fmi2.fmi2CallbackFunctions:
    """The callback functions of an FMI 2.0 FMU."""
    functions = fmi2.fmi2CallbackFunctions.from_buffer_copy(_CALLBACKS)
    functions.componentEnvironment = key
    return functions


def _log(key: int | None, name: bytes, status: int, category: bytes, message: bytes) -> None:
    keep_message(key or 0, status, message)


_CALLBACKS = fmi2.fmi2CallbackFunctions()
_CALLBACKS.logger = fmi2.fmi2CallbackLoggerTYPE(_log)
_CALLBACKS.allocateMemory = fmi2.defaultCallbacks.allocateMemory
_CALLBACKS.freeMemory = fmi2.defaultCallbacks.freeMemory
