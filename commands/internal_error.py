"""An exception that nobody has foreseen: a mistake in hapticlink, reported in a line; the traceback
goes to a file for whoever mends it. Those of a plugin are reported by `plugins.blame_plugin`."""

from __future__ import annotations

import platform
import shlex
import sys
import tempfile
import traceback
from importlib.metadata import PackageNotFoundError, version

PREFIX = "an error of hapticlink itself"
"""By which it differs from a fault of what it was given."""


def report_error(error: Exception) -> str:
    """What to tell the user; the report lies in the temporary folder."""
    what = "".join(traceback.format_exception_only(error)).strip()
    message = f"{PREFIX}, not of what it was given: {what[:300]}"
    try:
        return f"{message}\n  please report it, with {_written(error)}"
    except OSError as full:
        return f"{message}\n  a report cannot be written: {full}"


def _written(error: Exception) -> str:
    about = f"hapticlink {_version()}, Python {sys.version}, {platform.platform()}"
    lines = traceback.format_exception(error)
    text = f"{about}\n$ {shlex.join(sys.argv)}\n\n{''.join(lines)}"
    number, path = tempfile.mkstemp(prefix="hapticlink-error-", suffix=".txt")
    with open(number, "w", encoding="utf-8", errors="backslashreplace") as file:
        file.write(text)
    return path


def _version() -> str:
    try:
        return version("hapticlink")
    except PackageNotFoundError:  # run from a checkout
        return "not installed"
