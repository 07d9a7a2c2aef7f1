"""The caches in which zig keeps the C library that it builds for each target, which linking needs.

A second zig that starts within a tenth of a second of a first one with the same cache waits for a
lock until the first one has compiled, and two that find no library build it both. So each target
has a cache, which one zig uses at a time to link; compiling needs no cache.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hapticlink.fmus import cache, lock

CHOICE = "ZIG_GLOBAL_CACHE_DIR"
"""zig's own environment variable: a folder that the user has chosen is used as it is."""


@contextmanager
def linker_cache(target: str) -> Iterator[dict[str, str]]:
    """The environment variables to link for a target; none where no cache can be written."""
    root = cache.user_folder() / "zig"
    if CHOICE not in os.environ and _writable(root):
        with lock.held(root / f"{target}.lock", lambda: None):
            yield {CHOICE: str(root / target)}
    else:
        yield {}


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)
