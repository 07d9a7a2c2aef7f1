"""Versions of installed distributions, each read from its metadata once, and how to add extras."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from importlib import metadata

version = cache(metadata.version)
"""The version of a distribution by its name. Raises importlib.metadata.PackageNotFoundError."""


def find_versions(names: Iterable[str]) -> dict[str, str]:
    """The versions of those distributions that are installed: built FMUs run without what built
    them."""
    found = {}
    for name in names:
        with suppress(metadata.PackageNotFoundError):
            found[name] = version(name)
    return found


def install_command(extra: str) -> str:
    """The shell command that installs the packages of an extra of hapticlink.

    It is the same for a wheel and for a checkout, from any folder: pip takes the hapticlink that is
    installed, and adds what its extra requires. Double quotes are understood by every shell.
    """
    return f'pip install "hapticlink[{extra}]"'
