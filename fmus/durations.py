"""How long what is waited for took on this machine."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from time import monotonic

from hapticlink.fmus import cache
from hapticlink.fmus.atomic_file import atomic_file

FILE = "durations.json"
"""In the folder of the cache: minutes by what took them."""


@contextmanager
def record_duration(what: str) -> Iterator[float | None]:
    """Gives the longest duration (s) that something took on this machine, None where it is not
    known, and records how long it takes, unless an exception ends it."""
    folder, known = cache.folder(), dict[str, float]()
    if folder:
        with suppress(OSError, ValueError, AttributeError, TypeError):  # it may be damaged
            if (folder / FILE).is_file():
                read = json.loads((folder / FILE).read_text(encoding="utf-8"))
                known = {name: float(minutes) for name, minutes in read.items()}
    took, begun = known.get(what), monotonic()
    yield None if took is None else 60 * took
    if folder:
        known[what] = max((monotonic() - begun) / 60, took or 0.0)
        with suppress(OSError):
            cache.private(folder)
            with atomic_file(folder / FILE) as unfinished:
                unfinished.write_text(json.dumps(known, indent=1), encoding="utf-8")
