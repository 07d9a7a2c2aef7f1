"""An exception that nobody has foreseen: a mistake in hapticlink or in a plugin, told in a line;
the traceback goes to a file for whoever mends it."""

from __future__ import annotations

import os
import platform
import shlex
import sys
import tempfile
import traceback
from contextlib import suppress
from importlib.metadata import version

TOLD = "an error of hapticlink itself"
"""By which it is told from a fault of what it was given."""


def reported(error: Exception) -> str:
    """What to tell the user; the report lies in the temporary folder."""
    what = "".join(traceback.format_exception_only(error)).strip()
    told = f"{TOLD}, not of what it was given: {what[:300]}"
    with suppress(OSError):
        return f"{told}\n  please report it, with {_written(error)}"
    return f"{told}\n  there is no room for a report in {tempfile.gettempdir()}"


def _written(error: Exception) -> str:
    command = shlex.join(sys.argv)
    about = f"hapticlink {version('hapticlink')}, Python {sys.version}, {platform.platform()}"
    text = f"{about}\n{os.getcwd()}$ {command}\n\n{''.join(traceback.format_exception(error))}"
    number, path = tempfile.mkstemp(prefix="hapticlink-error-", suffix=".txt")
    with open(number, "w", encoding="utf-8", errors="backslashreplace") as file:
        file.write(text)
    return path
