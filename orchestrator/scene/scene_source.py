"""What a scene was read from: its tables and options, and the file and line of its keys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from hapticlink.orchestrator.base.errors import Finding
from hapticlink.orchestrator.scene.overrides import as_command_line
from hapticlink.orchestrator.scene.toml_keys import Path, Place, place_of


@dataclass(frozen=True)
class Source:
    """The tables of a scene, the options (`key=value`) still to be applied to them, and the file
    and line of each key. set_by: options already applied to the tables, by the paths that they
    set."""

    name: str
    tables: Mapping[str, Any]
    places: Mapping[Path, Place]
    options: tuple[str, ...] = ()
    set_by: Mapping[Path, str] = field(default_factory=dict)

    def finding(self, path: Path, message: str) -> Finding:
        """A finding at a path, located by the option that set it, or else by the line of the key or
        of the nearest table around it."""
        key = self._dotted(path)
        for length in range(len(path), 0, -1):
            if path[:length] in self.set_by:
                return Finding(key, message, option=as_command_line(self.set_by[path[:length]]))
        file, line = place_of(path, self.places)
        return Finding(key, message, line or None, file=file)

    def _dotted(self, path: Path) -> str:
        """The path as text, entries of arrays by index (from 0) and name:
        `linkage.body[2] (link3).mass`."""
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
