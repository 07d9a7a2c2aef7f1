"""Merges the tables of a file over those of the one that it extends."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hapticlink.orchestrator.scene.toml_keys import Path


def merge(
    base: dict[str, Any], top: Mapping[str, Any], replaced: set[Path], above: Path = ()
) -> dict[str, Any]:
    """`top` over `base`: tables merge key by key; other values of `top`, and tables of another
    `type`, replace those of `base`, at paths which are added to `replaced`."""
    merged = dict(base)
    for key, value in top.items():
        below = base.get(key)
        if isinstance(below, dict) and isinstance(value, dict) and _alike(below, value):
            value = merge(below, value, replaced, (*above, key))
        else:
            replaced.add((*above, key))
        merged[key] = value
    return merged


def _alike(below: Mapping[str, Any], table: Mapping[str, Any]) -> bool:
    return bool(table.get("type", below.get("type")) == below.get("type"))
