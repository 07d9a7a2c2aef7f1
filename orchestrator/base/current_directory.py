"""The current directory, which all threads share and any FMU may change."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager


def current() -> str | None:
    """The current directory; None where it has been removed."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return None


@contextmanager
def restored(*suspects: str) -> Iterator[None]:
    """After the context the current directory is the one from before it. That it was changed is
    logged as a warning, with the FMUs one of which has changed it."""
    before = current()
    try:
        yield
    finally:
        after = current()
        if before is not None and after != before:
            os.chdir(before)
            logging.getLogger(__name__).warning(
                "%s changed the current directory to %s: it is %s again",
                f"one of {', '.join(suspects)}" if len(suspects) > 1 else "".join(suspects),
                after or "a folder that was removed",
                before,
            )
