"""The licenses of what an FMU contains, as FMI has them beside its documentation."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from importlib import metadata

ENTRY = "documentation/licenses/license.txt"
"""Where importers look for them (FMI 2.0.5 section 2.3, FMI 3.0 section 2.5.1)."""


@cache
def licenses(with_python: bool) -> bytes:
    """The license of this project, and where an FMU contains it that of pythonfmu."""
    parts = []
    for name in ("hapticlink", *(["pythonfmu"] if with_python else [])):
        with suppress(metadata.PackageNotFoundError):  # not installed: run from a checkout
            text = metadata.distribution(name).read_text("licenses/LICENSE")
            parts += [f"{name}\n{'-' * len(name)}\n\n{text.strip()}\n"] if text else []
    return "\n".join(parts).encode()
