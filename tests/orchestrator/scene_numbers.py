"""Every number that the shipped scenes may hold, and values that it cannot have."""

import copy
import math
import typing
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, NamedTuple

from hypothesis import strategies as st

from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene import extends, find_scene, schema
from hapticlink.orchestrator.scene.rates import Exact
from hapticlink.orchestrator.scene.scene import Scene


class Number(NamedTuple):
    """A number of a scene: the path of its key, its place in the key's array, what the key holds
    now, and its quantity."""

    path: tuple[str | int, ...]
    place: tuple[int, ...]
    value: Any
    quantity: Quantity
    whole: bool


def numbers(hint: Any, value: Any, path: tuple[str | int, ...]) -> Iterator[Number]:
    """Every number that a key may hold: of its value's type, or of any where it has none."""
    for kind, quantity in schema.measured(hint):
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if kind in (float, int) and quantity and not isinstance(value, tuple):
            yield Number(path, (), value, quantity, kind is int and not isinstance(quantity, Exact))
        elif origin is Mapping and isinstance(value, Mapping):
            for name, each in value.items():
                yield from numbers(arguments[1], each, (*path, name))
        elif is_dataclass(kind) and isinstance(value, kind):
            for field in fields(value):
                key = field.name.rstrip("_")
                yield from numbers(
                    schema.hints(kind)[key], getattr(value, field.name), (*path, key)
                )
        elif origin is tuple and is_dataclass(arguments[0]):
            for i, each in enumerate(value or ()):
                yield from numbers(arguments[0], each, (*path, i))
        elif origin is tuple:
            yield from entries(kind, value, path)


def entries(kind: Any, value: Any, path: tuple[str | int, ...]) -> Iterator[Number]:
    """Every number of an array; of ones where the scene has none."""
    arguments = typing.get_args(kind)
    if value is None and Ellipsis not in arguments:
        value = (1.0,) * len(arguments)
    if not isinstance(value, tuple):
        return
    if Ellipsis in arguments:
        arguments = (arguments[0],) * len(value)
    for i, (argument, each) in enumerate(zip(arguments, value, strict=True)):
        for number in numbers(argument, each, ()):
            yield Number(path, (i, *number.place), value, number.quantity, number.whole)


SCENES = tuple(find_scene.shipped())


@cache
def document(name: str) -> dict[str, Any]:
    return extends.document(find_scene.find(name)[1], name, None)[0]


def tables(name: str) -> dict[str, Any]:
    """What a shipped scene and those that it extends write."""
    return copy.deepcopy(document(name))


@cache
def of_scene(name: str) -> list[Number]:
    every = numbers(Scene, open_scene.load(name).plain(), ())
    return [number for number in every if number.quantity.unit != "the variable's own"]


def beyond(number: Number) -> st.SearchStrategy[Any]:
    """Values that the number cannot have."""
    low = max((b for n, b in number.quantity.bounds.items() if n in ("gt", "ge")), default=None)
    high = min((b for n, b in number.quantity.bounds.items() if n in ("lt", "le")), default=None)
    found: list[st.SearchStrategy[Any]] = []
    if number.whole:
        assert low is not None
        found.append(st.integers(-(2**63), int(low) - 1))
        if high is not None and high < 2**63 - 1:
            found.append(st.integers(int(high) + 1, 2**63 - 1))
        return st.one_of(found)
    if low is not None:
        found.append(st.floats(max_value=low, exclude_max="ge" in number.quantity.bounds))
    if high is not None:
        found.append(st.floats(min_value=high, exclude_min="le" in number.quantity.bounds))
    if isinstance(number.quantity, Exact):
        found.append(st.sampled_from(["0/7", "-1/30", "1e7", "1e300"]))
    return st.one_of(*found, st.sampled_from([math.nan, math.inf, -math.inf]))


def put(value: Any, place: tuple[int, ...], number: Any) -> Any:
    """`value`, with `number` at a place of its array."""
    if not place:
        return number
    return [put(each, place[1:], number) if i == place[0] else each for i, each in enumerate(value)]


def toml(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def key(number: Number) -> str:
    parts = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in number.path)
    return parts[1:] + "".join(f"[{i}]" for i in number.place)
