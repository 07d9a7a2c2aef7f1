"""What FMUs log: the newest messages of each, by the key of its instance, which a fault shows; and
all of them in a file, one in a line, up to a bound:

    0.5    drill    warning    logStatusWarning    the valve is shut

that is where the instance stood (s), its name, the status and the category of the message, and its
text, with tabs between.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path

from fmpy import fmi2

from hapticlink.orchestrator.fmi.status import STATUS

MAX_MESSAGES, MAX_LENGTH = 5, 2000
"""Messages of an instance that are kept for a fault, and characters of one."""
MAX_WRITTEN = 1000
"""Messages of an instance that are written to the file: so many that are mere information, and so
many others. How many more there were of each status is written last."""
LEFT_OUT = "left out"

_messages: dict[int, deque[str]] = {}
_files: dict[int, LogFile] = {}
_keys = count(1)


class LogFile:
    """Where the messages of the instance `name` are written, and those of other instances, of other
    processes too. time: where the instance stands (s). No file stays open, which an FMU might
    close."""

    def __init__(self, path: str, name: str, time: Callable[[], float]) -> None:
        self._path, self._name, self._time = path, name, time
        self._written, self._left_out = Counter[bool](), Counter[str]()

    def write(self, status: str, category: str, text: str) -> None:
        """Append a message, or count it where there are many."""
        informs = status == STATUS[0]
        if self._written[informs] >= MAX_WRITTEN:
            self._left_out[status] += 1
            return
        self._written[informs] += 1
        self._append(status, category, text)

    def close(self) -> None:
        """Append how many messages were left out."""
        for status, number in self._left_out.items():
            self._append(status, LEFT_OUT, str(number))

    def _append(self, *fields: str) -> None:
        each = (f"{self._time():.9g}", self._name, *fields)
        line = "\t".join(" ".join(field.split()) for field in each)
        content = f"{line}\n".encode(errors="replace")  # a line is one write
        # A message is no reason to end a run.
        with suppress(OSError), open(self._path, "ab", buffering=0) as file:
            file.write(content)


def open_log(key: int | None = None) -> int:
    """A key for a new instance, or the one that it had before; its messages are kept from now
    on."""
    key = next(_keys) if key is None else key
    _messages[key] = deque(maxlen=MAX_MESSAGES)
    return key


def write_to(key: int, path: str, name: str, time: Callable[[], float]) -> None:
    """Write the messages of instance `key` to a file, too."""
    _files[key] = LogFile(path, name, time)


def keep_message(key: int, status: int, message: bytes, category: bytes = b"") -> None:
    """Keep a message of instance `key`, to be shown if a call fails, and write it down."""
    own = _messages.get(key)
    if own is None:
        return
    text = (message or b"")[: 4 * MAX_LENGTH].decode("utf-8", "replace").strip()[:MAX_LENGTH]
    if status != 0:
        own.append(text)
    if file := _files.get(key):
        named = STATUS[status] if 0 <= status < len(STATUS) else str(status)
        file.write(named, (category or b"")[:200].decode("utf-8", "replace"), text)


def newest_messages(key: int) -> list[str]:
    return [*_messages.get(key, ())]


def close_log(key: int) -> None:
    _messages.pop(key, None)
    if file := _files.pop(key, None):
        file.close()


def count_messages(path: Path) -> dict[str, dict[str, int]]:
    """The number of messages in a log, by instance and status."""
    found: dict[str, Counter[str]] = {}
    for name, status, number in _read_counts(path):
        found.setdefault(name, Counter())[status] += number
    return {name: dict(counts) for name, counts in found.items()}


def _read_counts(path: Path) -> Iterator[tuple[str, str, int]]:
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return
    for line in lines:
        fields = line.split("\t")
        if len(fields) == 5:
            yield fields[1], fields[2], int(fields[4]) if fields[3] == LEFT_OUT else 1


def callbacks(key: int) -> fmi2.fmi2CallbackFunctions:
    """The callback functions of an FMI 2.0 FMU."""
    functions = fmi2.fmi2CallbackFunctions.from_buffer_copy(_CALLBACKS)
    functions.componentEnvironment = key
    return functions


def _log(key: int | None, name: bytes, status: int, category: bytes, message: bytes) -> None:
    keep_message(key or 0, status, message, category)


_CALLBACKS = fmi2.fmi2CallbackFunctions()
_CALLBACKS.logger = fmi2.fmi2CallbackLoggerTYPE(_log)
_CALLBACKS.allocateMemory = fmi2.defaultCallbacks.allocateMemory
_CALLBACKS.freeMemory = fmi2.defaultCallbacks.freeMemory
