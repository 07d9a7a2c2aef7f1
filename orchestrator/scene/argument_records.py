"""Records of the arguments of functions that plugins write, read as strictly as a scene."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from dataclasses import field, make_dataclass
from functools import cache
from typing import Any

import pydantic
from pydantic_core import to_json

from hapticlink.orchestrator.base.errors import InputFault, shorten
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path


def make_record(
    name: str, arguments: Iterable[inspect.Parameter], module: str, *first: tuple[str, Any]
) -> Any:
    """A record with the fields `first`, and one for each of the arguments of a function of that
    module."""
    named = ((a.name, a.annotation, field(**_default(a))) for a in arguments)
    record = make_dataclass(name, [*first, *named], kw_only=True)
    # Resolves annotations that are texts; from Python 3.12 on make_dataclass sets it by itself.
    record.__module__ = module
    return record


def _default(argument: inspect.Parameter) -> dict[str, Any]:
    given = argument.default
    return {} if given is argument.empty else {"default_factory": lambda: given}


def read_strictly(record: Any, table: Any) -> Any:
    """The record of a table. Raises pydantic.ValidationError, whose paths begin with "table"."""
    text = to_json({"table": table}, inf_nan_mode="constants")
    return _reader(record).validate_json(text).table


def errors_at(path: Path, error: pydantic.ValidationError) -> list[Any]:
    """The errors of `read_strictly` in the table at `path` of a scene."""
    return [{**e, "loc": (*path, *e["loc"][1:])} for e in error.errors(include_url=False)]


@cache
def _reader(record: Any) -> pydantic.TypeAdapter[Any]:
    """A pydantic reader of a record with a scene's strictness: no unknown keys, no text for a
    number."""
    rules = {"__pydantic_config__": Scene.__pydantic_config__}
    holder = make_dataclass("Holder", [("table", record)], namespace=rules)
    try:
        reader: pydantic.TypeAdapter[Any] = pydantic.TypeAdapter(holder)
        reader.rebuild(raise_errors=True)
        return reader
    except (pydantic.errors.PydanticUserError, NameError) as error:
        why = shorten(str(error).partition("\n")[0])
        message = f"{record.__module__}: the annotations of {record.__name__} cannot be read: {why}"
        raise InputFault(message) from error
