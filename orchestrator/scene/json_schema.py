"""A JSON schema (draft 2020-12) of scene files, made from the records, for editors.

It says what each key may hold. Tables that a scene extends may say the rest, so that only entries
of arrays, which are not laid over each other, require their keys.
"""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import MISSING, is_dataclass
from types import NoneType
from typing import Any

from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.scene import key_descriptions, schema
from hapticlink.orchestrator.scene.families import Family
from hapticlink.orchestrator.scene.toml_keys import NAMED

DRAFT = "https://json-schema.org/draft/2020-12/schema"
_TYPES = {float: "number", int: "integer", str: "string", bool: "boolean"}
_KEYWORDS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}
_FRACTION = r"^[0-9]+/[0-9]+$|^[0-9]*\.?[0-9]+([eE][+-]?[0-9]{1,3})?$"

Json = dict[str, Any]


def json_schema() -> Json:
    """The schema of a scene file."""
    tables: dict[str, Json] = {}
    scene = _table(schema.Scene, False, tables)
    return {
        "$schema": DRAFT,
        "title": "hapticlink scene",
        **scene,
        "anyOf": [{"required": ["extends"]}, {"required": ["title", "duration"]}],
        "$defs": tables,
    }


def _table(record: Any, entry: bool, tables: dict[str, Json]) -> Json:
    """A record as a table, one of an array with its keys required."""
    properties, required = {}, []
    for key, hint in schema.hints(record).items():
        found = _value(hint, entry, tables)
        ...
    return {}
