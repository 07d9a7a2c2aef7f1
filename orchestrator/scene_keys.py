"""Tables whose keys are names with dots, `holds."virtual_environment.P_c"`: written in quotes, as
bare dotted keys or as tables in tables, they say the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import fields
from typing import Any

from hapticlink.orchestrator.latency import Latency

NAMED = ("holds", "delays", "kinds")
LATENCY = {f.name for f in fields(Latency)}


def flat(
    table: Mapping[str, Any], leaves: Set[str] = frozenset(), prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    """The entries of a table under their whole names; a value with one of the keys `leaves`, or
    under a whole name, is a table of its own."""
    for key, value in table.items():
        inside = isinstance(value, dict) and value
        if inside and not (leaves and ("." in key or value.keys() & leaves)):
            yield from flat(value, leaves, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def flatten(data: dict[str, Any]) -> None:
    """Writes the scene's own such tables under whole names."""
    for table in NAMED:
        if isinstance(data.get(table), dict):
            data[table] = dict(flat(data[table], LATENCY if table == "delays" else frozenset()))


def whole(names: tuple[Any, ...]) -> tuple[Any, ...]:
    """The path of the names of a dotted key, in the tables that `flatten` has written."""
    if names[0] not in NAMED or len(names) < 3 or "." in names[1]:
        return names
    end = len(names) - (names[0] == "delays" and names[-1] in LATENCY)
    return (names[0], ".".join(names[1:end]), *names[end:])
