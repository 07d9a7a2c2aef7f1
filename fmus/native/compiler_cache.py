"""Caches of zig, in which it keeps the C library that it builds for each target.

A second zig that starts within a tenth of a second of a first one with the same cache waits for a
lock until the first one has compiled. Compilers that run at the same time have a cache each: the
first one of a row of caches that is not in use. Each is 50 MB, copied from the first one.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from hapticlink.fmus import cache, lock

CHOICE = "ZIG_GLOBAL_CACHE_DIR"
"""zig's own environment variable: a folder that the user has chosen is used as it is."""


@contextmanager
def compiler_cache() -> Iterator[dict[str, str]]:
    """The environment variables for a compiler; none where no cache can be written."""
    if CHOICE in os.environ:
        yield {}
        return
    root = cache.user_folder() / "zig"
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError:
        yield {}
        return
    for k in count():
        with lock.attempted(root / f"{k}.lock") as mine:
            if mine:
                if k:
                    _copy(root / "0", root / str(k))
                yield {CHOICE: str(root / str(k))}
                return


def _copy(first: Path, to: Path) -> None:
    """Copies `first`, which may be in use, unless there is a copy. What zig finds incomplete, it
    builds again."""
    unfinished = to.with_suffix(".part")
    if not to.exists():
        shutil.rmtree(unfinished, ignore_errors=True)
        with suppress(OSError, shutil.Error):
            shutil.copytree(first, unfinished, ignore=shutil.ignore_patterns("tmp"))
            unfinished.rename(to)
