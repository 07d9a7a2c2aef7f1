"""A hold with parameters, as a table of a scene: `hold = { type = "alpha-beta", alpha = 0.5 }`.

The scene keeps the hold's name with them (`orchestrator.holds`), and may write it so itself.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import pydantic

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.holds import HOLDS, HoldRow, parameters_in
from hapticlink.orchestrator.scene.argument_records import errors_at, make_record, read_strictly
from hapticlink.orchestrator.scene.overrides import toml
from hapticlink.orchestrator.scene.toml_keys import Path, Problem, entries, value


@dataclass(frozen=True, kw_only=True)
class HoldTable:
    """A hold of a plugin with parameters, the other keys of the table."""

    type: str
    """Its name."""


def parameters_of(name: Any) -> Any:
    """The record of the table of a hold; None where there is none of that name."""
    return _record(HOLDS[name]) if isinstance(name, str) and name in tuple(HOLDS) else None


@cache
def _record(kind: Any) -> Any:
    own = [] if isinstance(kind, HoldRow) else [*inspect.signature(kind).parameters.values()]
    module = getattr(kind, "__module__", __name__)
    return make_record("HoldParameters", own[1:], module, ("type", str))  # behind the context


def find_hold_tables(data: Any) -> Iterator[tuple[Path, Any]]:
    """Path and content of each hold of a scene's `data` that has, or could have, parameters."""
    named = value(data, ("holds",))
    paths: list[Path] = [("hold",), ("downsampling",)]
    paths += [("holds", name) for name in (named if isinstance(named, dict) else ())]
    paths += [("connection", i, "hold") for i in range(len(entries(data, "connection")))]
    for path in paths:
        found = value(data, path)
        if isinstance(found, dict) or (isinstance(found, str) and _may_have_parameters(found)):
            yield path, found


def _may_have_parameters(name: str) -> bool:
    return "(" in name or (name in tuple(HOLDS) and not isinstance(HOLDS[name], HoldRow))


def read_hold_tables(data: Any) -> tuple[list[Any], list[Problem]]:
    """Puts names in the place of the tables of holds in a scene's `data`; pydantic's errors in
    those that cannot be read, and the problems found besides."""
    errors: list[Any] = []
    wrong: list[Problem] = []
    for path, found in [*find_hold_tables(data)]:
        holder = value(data, path[:-1])
        try:
            holder[path[-1]] = table = _table(found)
            if (record := parameters_of(table.get("type"))) is None:
                holder[path[-1]] = "zoh"
                wrong.append(((*path, "type"), _unknown(table)))
                continue
            holder[path[-1]] = _name(read_strictly(record, table), table)
        except pydantic.ValidationError as error:
            errors += errors_at(path, error)
        except ValueError as error:
            holder[path[-1]] = "zoh"
            wrong.append((path, f"{found}: {error}: write {{ type = NAME, PARAMETER = VALUE }}"))
    return errors, wrong


def write_hold_tables(data: Any) -> None:
    """Puts tables in the place of the names of holds with parameters, so that these are keys."""
    for path, found in [*find_hold_tables(data)]:
        if isinstance(found, str) and parameters_in(found):
            value(data, path[:-1])[path[-1]] = _table(found)


def read_hold(name: str) -> str:
    """The name of a hold with parameters, checked. Raises InputFault."""
    data = {"hold": name}
    errors, wrong = read_hold_tables(data)
    if why := [*(f"{e['loc'][-1]}: {e['msg']}" for e in errors), *(why for _, why in wrong)]:
        raise InputFault(f"hold = {name}: {'; '.join(why)}")
    if HOLDS.base_name(name) not in HOLDS:
        raise InputFault(HOLDS.unknown(name))
    return data["hold"]


def _table(found: Any) -> dict[str, Any]:
    if isinstance(found, dict):
        return found
    return {"type": HOLDS.base_name(found), **parameters_in(found)}


def _unknown(table: dict[str, Any]) -> str:
    if "type" not in table:
        return "is missing: which hold is it?"
    return HOLDS.unknown(str(table["type"]))


def _name(record: Any, table: dict[str, Any]) -> str:
    """The name of a hold with the parameters that are given, in the order of its constructor."""
    given = [f.name for f in fields(record) if f.name != "type" and f.name in table]
    texts = ", ".join(f"{name}={toml(getattr(record, name), name)}" for name in given)
    return f"{record.type}({texts})" if texts else str(record.type)
