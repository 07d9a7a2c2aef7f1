"""Ranges that no value of a scene may leave, in a file, an option or an SSP."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hapticlink.orchestrator.scene.toml import DEEPEST
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def unsound(value: Any, path: Path = ()) -> Iterator[Problem]:
    """What no scene can hold, and where: tables without end, whole numbers that no type of FMI
    can, dates, text that cannot be written to a file."""
    if len(path) > DEEPEST:
        yield path, f"more than {DEEPEST} tables or lists within one another: write it flatter"
    elif isinstance(value, dict):
        for key, inside in value.items():
            if not _is_unicode(key):
                yield (*path, ascii(key)), "is no Unicode text: write it in UTF-8"
            yield from unsound(inside, (*path, key))
    elif isinstance(value, list):
        for i, inside in enumerate(value):
            yield from unsound(inside, (*path, i))
    elif isinstance(value, str):
        if not _is_unicode(value):
            yield path, f"{value[:100]!a} is no Unicode text: write it in UTF-8"
    elif isinstance(value, int):
        if not -(2**63) <= value < 2**64:
            yield path, "a whole number of more than 64 bits: write it with a point, as 1.0e30"
    elif not isinstance(value, float | None):
        yield path, f"{value} should be a number, a text, true, false, a list or a table"


def _is_unicode(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
