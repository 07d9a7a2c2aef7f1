"""Readers and writers of types by pydantic."""

from __future__ import annotations

from functools import cache
from typing import Any

from pydantic import TypeAdapter

adapter = cache(TypeAdapter[Any])
"""That of a type, made once: the reader of scenes takes ten times as long to make as a scene to
read."""
