"""Versions of installed distributions, each read from its metadata once, the code of hapticlink
itself, and how to add extras."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path

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


@cache
def find_code() -> dict[str, str]:
    """What tells the code of hapticlink that runs: of a checkout its `commit`, with "-dirty" where
    files of it differ; of an installed wheel the SHA-256 of its RECORD, the list of its files with
    the hash of each (`wheel`). Empty where neither is there."""
    checkout = Path(__file__).resolve().parents[1]
    if (checkout / ".git").exists():
        command = ["git", "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
        with suppress(OSError, subprocess.SubprocessError):
            made = subprocess.run(
                command, cwd=checkout, capture_output=True, text=True, check=True, timeout=10
            )
            return {"commit": made.stdout.strip()}
        return {}
    with suppress(metadata.PackageNotFoundError):
        if record := metadata.distribution("hapticlink").read_text("RECORD"):
            return {"wheel": f"sha256:{hashlib.sha256(record.encode()).hexdigest()}"}
    return {}


def install_command(extra: str) -> str:
    """The shell command that installs the packages of an extra of hapticlink.

    It is the same for a wheel and for a checkout, from any folder: pip takes the hapticlink that is
    installed, and adds what its extra requires. Double quotes are understood by every shell.
    """
    return f'pip install "hapticlink[{extra}]"'
