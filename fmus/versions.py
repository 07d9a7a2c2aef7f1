"""Versions of installed distributions, each read from its metadata once."""

from __future__ import annotations

from functools import cache
from importlib import metadata

version = cache(metadata.version)
"""The version of a distribution by its name. Raises importlib.metadata.PackageNotFoundError."""
