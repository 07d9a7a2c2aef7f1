"""What a scene was read from: where its keys stand, and how it is read with further options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from hapticlink.orchestrator.base.faults import Finding
from hapticlink.orchestrator.scene.toml_keys import Path, Place, place_of


@dataclass(frozen=True)
class Source:
    """The tables of a scene before its `options` (`key=value`), and where each key stands; set_by
    are options that the tables hold already, by the paths that they set."""

    name: str
    tables: Mapping[str, Any]
    places: Mapping[Path, Place]
    options: tuple[str, ...] = ()
    set_by: Mapping[Path, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Origin:
    """The tables of a source with its options, and which option set what."""

    source: Source
    tables: Mapping[str, Any]
    set_by: Mapping[Path, str]

    def finding(self, path: Path, message: str) -> Finding:
        """What is wrong at a path: with the option, or the line of the key or of its table."""
        key = self._dotted(path)
        for length in range(len(path), 0, -1):
            if path[:length] in self.set_by:
                return Finding(key, message, option=f"--set {self.set_by[path[:length]]}")
        file, line = place_of(path, self.source.places)
        return Finding(key, message, line or None, file=file)

    def _dotted(self, path: Path) -> str:
        """`linkage.body[2] (link3).mass`: entries of arrays from 0, with their name."""
        text = ""
        node: Any = self.tables
        for part in path:
            try:
                node = node[part]
            except (KeyError, IndexError, TypeError):
                node = None
            if isinstance(part, int):
                name = node.get("name") if isinstance(node, dict) else None
                text += f"[{part}]" + (f" ({name})" if name else "")
            else:
                text += f".{part}" if text else part
        return text
