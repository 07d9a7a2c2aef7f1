"""One run at a time writes to a result folder."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hapticlink.fmus import lock
from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results import folders


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Within the context no other run, of this process or another one of this machine, writes to
    `folder`, which is created if necessary and removed again if it stays empty. The lock ends with
    the process, and leaves no file.

    Raises InputFault at once where another run holds the lock, or where the folder cannot be
    written to.
    """
    missing = [p for p in (folder, *folder.parents) if not os.path.exists(p)]
    folders.ensure(folder)
    file = folder / ".run.lock"  # on Windows, where a folder has no lock of its own
    try:
        with lock.try_lock(file if sys.platform == "win32" else folder) as locked:
            if not locked:
                known = f", in process {process}" if (process := find_process(folder)) else ""
                raise InputFault(
                    f"--out {folder}: another run writes there{known}; wait for its end, or name "
                    "another folder"
                )
            yield
        file.unlink(missing_ok=True)
    finally:
        with suppress(OSError):  # it has results
            for path in missing:
                path.rmdir()


def find_process(folder: Path) -> int | None:
    """The process ID of the run in progress in `folder`, from its run.json; None without one."""
    with suppress(InputFault, ValueError, LookupError, TypeError, AttributeError):
        return int(text_files.read_json(folder / "run.json")["end"]["process"])
    return None
