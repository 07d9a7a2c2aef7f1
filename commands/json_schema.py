"""JSON schema (draft 2020-12) of scene files, generated from the records, for editors.

It states what each key may hold and refuses unknown keys. Keys that a table lacks may come from the
scene that it extends, so only entries of arrays, which are not merged, require theirs.
"""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import MISSING, is_dataclass
from types import NoneType
from typing import Any

from hapticlink.components.specs.device import Device
from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.scene import key_descriptions, types_of_keys
from hapticlink.orchestrator.scene.device_files import NAMED as BY_NAME
from hapticlink.orchestrator.scene.hold_tables import HoldTable
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import ForeignFmu
from hapticlink.orchestrator.scene.toml_keys import NAMED

DRAFT = "https://json-schema.org/draft/2020-12/schema"
_TYPES = {float: "number", int: "integer", str: "string", bool: "boolean"}
_KEYWORDS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}
_FRACTION = r"^[0-9]+/[0-9]+$|^[0-9]*\.?[0-9]+([eE][+-]?[0-9]{1,3})?$"
Json = dict[str, Any]


def json_schema() -> Json:
    definitions = _Definitions()
    scene = definitions.table(Scene, entry=False)
    return {
        "$schema": DRAFT,
        "title": "hapticlink scene",
        **scene,
        "anyOf": [{"required": ["extends"]}, {"required": ["title", "duration"]}],
        "$defs": definitions.found,
    }


def _measure(kind: Any) -> str:
    """Unit and range of a value as a suffix, ` (N/m; >= 0)`; "" where it has neither."""
    found = [text for text in (key_descriptions.unit(kind), key_descriptions.limits(kind)) if text]
    return f" ({'; '.join(found)})" if found else ""


class _Definitions:
    """Collects the tables that the schema refers to by name ($defs)."""

    def __init__(self) -> None:
        self.found: dict[str, Json] = {}

    def _reference(self, record: Any, entry: bool) -> Json:
        name = record.__name__ + ("Entry" if entry else "")
        if name not in self.found:
            self.found[name] = self.table(record, entry)
        return {"$ref": f"#/$defs/{name}"}

    def table(self, record: Any, entry: bool) -> Json:
        """The schema of a record; required keys are stated for an `entry` of an array only."""
        properties, required = {}, []
        for key, hint in types_of_keys.hints(record).items():
            default = types_of_keys.default(record, key)
            found = self._any_of(hint, entry)
            if isinstance(default, str | bool | int | float | tuple) and default != ():
                found["default"] = default
            dotted = {Scene: NAMED, ForeignFmu: ("start", "derivatives")}.get(record, ())
            if key in dotted:
                # A dotted name may also be written as nested tables.
                values = {"anyOf": [found["additionalProperties"], {"type": "object"}]}
                found["additionalProperties"] = values
            if record is Device and key in BY_NAME:
                (entries,) = (branch for branch in typing.get_args(hint) if is_dataclass(branch))
                changed = {
                    "type": "object",
                    "additionalProperties": self._reference(entries, False),
                }
                found = {"anyOf": [found, changed]}
            about = key_descriptions.meanings(record)[key]
            properties[key] = {"description": about + _measure(hint), **found}
            if default is MISSING:
                required.append(key)
        table = {
            "type": "object",
            "description": key_descriptions.about(record),
            "properties": properties,
            "additionalProperties": record is HoldTable,  # parameters, which a plugin defines
        }
        return {**table, "required": required} if entry and required else table

    def _any_of(self, kind: Any, entry: bool) -> Json:
        found: list[Json] = []
        for branch, beside in types_of_keys.find_quantities(kind):
            if branch is not NoneType and (one := self._one(branch, beside, entry)) not in found:
                found.append(one)
        return dict(found[0]) if len(found) == 1 else {"anyOf": found}

    def _one(self, kind: Any, quantity: Quantity | None, entry: bool) -> Json:
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if origin is typing.Literal:
            return {"enum": list(arguments)}
        if kind is Any:  # defined by a part of a registry, such as a block or a force
            return {}
        if origin is tuple and Ellipsis in arguments:
            of_tables = is_dataclass(arguments[0])
            return {"type": "array", "items": self._any_of(arguments[0], entry or of_tables)}
        if origin is tuple:
            entries = [self._any_of(argument, entry) for argument in arguments]
            count = len(entries)
            return {"type": "array", "prefixItems": entries, "minItems": count, "maxItems": count}
        if origin is Mapping:
            return {"type": "object", "additionalProperties": self._any_of(arguments[1], entry)}
        if is_dataclass(kind):
            return self._reference(kind, entry)
        if kind is str and quantity:
            return {"type": "string", "pattern": _FRACTION, "maxLength": 50}
        bounds = quantity.bounds if quantity else {}
        return {"type": _TYPES[kind], **{_KEYWORDS[name]: b for name, b in bounds.items()}}
