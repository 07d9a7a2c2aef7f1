"""The structures and the numbers of loop.h, by their names there. Pointers are addresses."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import CodeType, MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticlink.orchestrator.fmi.instance import StepState
from hapticlink.orchestrator.run.compiled.build import HERE

_COUNT = re.compile(r"/\* \[(.*?)\] \*/")
_NO_COUNTS: Mapping[str, int] = MappingProxyType({})
_STATE = "@"
_COMMENT = re.compile(r"/\*.*?\*/", re.S)
_DECLARED = re.compile(
    r"typedef struct \{(?P<fields>.*?)\} (?P<name>\w+);|enum \{(?P<numbers>[^=]*?)\}", re.S
)
_FIELD = re.compile(
    r"\(?(?P<stars>\**)(?P<name>\w+)\)?(\[(?P<n>\d+)\]|\(.*\))?\s*(<(?P<count>.*)>)?"
)


@dataclass(frozen=True)
class Pointer:
    """A field that is a pointer: to `count` entries, an expression in fields, each of `width`
    times `type`, or a pointer to that where it has two stars. used: of these, those in use."""

    type: str
    stars: int
    width: int
    count: str
    used: str


POINTERS: dict[str, dict[str, Pointer]] = {}
"""The pointers of each structure, by field."""
STATE: dict[str, list[str]] = {}
"""The fields of each structure that are its state, those behind the comment `state:`."""


class Structure(ctypes.Structure):
    """A structure of loop.h, which lives as long as its memory does; as an object of Python it also
    keeps what `fill` has given its fields, in `kept`."""

    kept: dict[str, Any]

    def fill(self, source: object = None, *names: str, **fields: object) -> None:
        """Set `fields`, and those of these names to the attributes of `source` that have them. A
        pointer is given by what it points to: an array, an object of ctypes, a function of a
        library; or by its address, None for NULL. Raises AttributeError for a name that either
        lacks."""
        values = {name: getattr(source, name) for name in names} | fields
        for name, value in values.items():
            setattr(self, name, _address(value))
        vars(self).setdefault("kept", {}).update(values)


_IN_MEMORY = (ctypes._SimpleCData, ctypes.Structure, ctypes.Array)


def _address(value: Any) -> Any:
    """The address of what a pointer points to; any other value itself."""
    if type(value) is int or type(value) is float:
        return value
    if isinstance(value, np.ndarray):
        return value.ctypes.data
    if callable(value):
        return ctypes.cast(value, ctypes.c_void_p).value
    if isinstance(value, _IN_MEMORY):
        return ctypes.addressof(value)
    return value


def _declared(text: str) -> dict[str, Any]:
    """The structures and numbers of a header whose fields are all of 2 or 8 bytes."""
    types: dict[str, Any] = {
        "double": ctypes.c_double, "int64_t": ctypes.c_int64, "int16_t": ctypes.c_int16,
        "uint64_t": ctypes.c_uint64,
    }  # fmt: skip

    def fields(name: str, body: str) -> Iterator[tuple[str, Any]]:
        constant, _, state = body.partition(_STATE)
        n_constant = constant.count(";")
        for i, declaration in enumerate((constant + state).split(";")[:-1]):
            kind, names = declaration.replace("const ", "").split(maxsplit=1)
            for field in map(_FIELD.fullmatch, re.split(r",\s*", names)):
                assert field, declaration
                entry = types[kind] if not field["stars"] else ctypes.c_void_p
                several = field["n"] and not field["stars"]
                if _STATE in body and i >= n_constant:
                    STATE.setdefault(name, []).append(field["name"])
                if stars := len(field["stars"]):
                    count, _, used = (field["count"] or "1").partition("|")
                    of = Pointer(kind, stars, int(field["n"] or 1), count, used or count)
                    POINTERS.setdefault(name, {})[field["name"]] = of
                yield field["name"], entry * int(field["n"]) if several else entry

    text = _COUNT.sub(r"<\1>", text.replace("/* state: */", _STATE))
    for declared in _DECLARED.finditer(_COMMENT.sub("", text)):
        if name := declared["name"]:
            rows = [*fields(name, declared["fields"])]
            types[name] = type(name, (Structure,), {"_fields_": rows})
        else:
            names = re.findall(r"\w+", declared["numbers"])
            types |= {name: number for number, name in enumerate(names)}
    return types


def evaluate(expression: str, known: Sequence[Any], counts: Mapping[str, int] = _NO_COUNTS) -> int:
    """The number that an expression of loop.h gives: in fields of structures, the nearest first,
    and in `counts`; a pointer to a number is an array of it."""
    return int(eval(_compiled(expression), {"__builtins__": {}}, _Fields(known, counts)))


def names(expression: str) -> tuple[str, ...]:
    """The fields that an expression of loop.h reads."""
    return _compiled(expression).co_names if expression else ()


@cache
def _compiled(expression: str) -> CodeType:
    return compile(expression.strip(), "loop.h", "eval")


class _Fields(dict[str, Any]):
    def __init__(self, known: Sequence[Any], counts: Mapping[str, int]) -> None:
        super().__init__()
        self._known, self._given = known, counts

    def __missing__(self, name: str) -> Any:
        for entry in self._known:
            if hasattr(entry, name):
                value = getattr(entry, name)
                is_pointer = name in POINTERS.get(type(entry).__name__, {})
                return (ctypes.c_int64 * 1).from_address(value) if is_pointer else value
        return self._given[name]


_TYPES = _declared((HERE / "loop.h").read_text(encoding="utf-8"))
assert [*_TYPES.pop("StepState")._fields_] == [*StepState._fields_]
globals().update(_TYPES)

if TYPE_CHECKING:

    def __getattr__(name: str) -> Any: ...
