"""What a scene was read from, so that it can be read again with further options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hapticlink.orchestrator.scene.toml_keys import Path, Place


@dataclass(frozen=True)
class Source:
    """The tables of a scene before its `options` (`key=value`), and where each key stands."""

    name: str
    tables: Mapping[str, Any]
    places: Mapping[Path, Place]
    options: tuple[str, ...] = ()
