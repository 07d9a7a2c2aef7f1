"""Readers and writers of records by pydantic."""

from __future__ import annotations

from functools import cache
from typing import Any

from pydantic import TypeAdapter


@cache
def adapter(kind: Any) -> TypeAdapter[Any]:
    """The reader of a type, made once: that of scenes takes ten times as long to make as a scene to
    read."""
    return TypeAdapter(kind)
