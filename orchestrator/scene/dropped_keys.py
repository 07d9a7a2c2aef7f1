"""`drop`: keys of the base scene that a scene which extends it does not inherit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from hapticlink.orchestrator.base.errors import shortened, unknown
from hapticlink.orchestrator.scene.toml_keys import parts


def taken(base: dict[str, Any], keys: Any, refuse: Callable[[str], Exception]) -> dict[str, Any]:
    """The tables of `base` without the dotted `keys`. Raises `refuse` with the reason where `keys`
    is no list of them, or names one that the base does not have."""
    if not isinstance(keys, list) or not all(isinstance(key, str) for key in keys):
        raise refuse(f"{shortened(repr(keys))}: write a list of dotted keys")
    for key in keys:
        try:
            names = parts(key)
        except ValueError:
            raise refuse(f"{shortened(key)!r} is no dotted key") from None
        base = _without(base, names, refuse)
    return base


def _without(
    table: dict[str, Any], names: tuple[str, ...], refuse: Callable[[str], Exception]
) -> dict[str, Any]:
    first, *rest = names
    if first not in table:
        raise refuse(f"not in the base scene: {unknown('key', first, [*table])}")
    if not rest:
        return {key: value for key, value in table.items() if key != first}
    if not isinstance(table[first], Mapping):
        raise refuse(f"{shortened(first)} is no table in the base scene: drop it as a whole")
    return {**table, first: _without(table[first], tuple(rest), refuse)}
