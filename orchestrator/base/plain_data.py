"""Records as plain data."""

from __future__ import annotations

from typing import Any

_LEAVES = frozenset({float, int, str, bool, type(None)})


class Plain(dict[str, Any]):
    """Plain data, which need not be made so again."""


def plain(value: Any) -> Any:
    """As `dataclasses.asdict`, which copies a scene number by number and takes ten times as
    long."""
    if type(value) in _LEAVES or type(value) is Plain:
        return value
    if (names := getattr(value, "__dataclass_fields__", None)) is not None:
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [plain(entry) for entry in value]
    if isinstance(value, tuple):
        entries = map(plain, value)
        return type(value)(*entries) if hasattr(value, "_fields") else tuple(entries)
    return value
