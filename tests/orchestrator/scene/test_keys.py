"""Every key of a scene has a meaning, and every number a unit and a range: out of it, it is refused
with its key, its place, the range and the unit."""

import math
import re
import shlex
import typing
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import chain
from typing import Any, NamedTuple

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.commands.json_schema import json_schema
from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.scene import (
    extends,
    find_scene,
    key_descriptions,
    overrides,
    read_and_check,
    types_of_keys,
)
from hapticlink.orchestrator.scene.rates import Exact
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_source import Source


def records(hint: Any) -> Iterator[Any]:
    """Every record that is reached from a type."""
    for kind in types_of_keys.branches(hint):
        if is_dataclass(kind):
            yield kind
            yield from chain.from_iterable(map(records, types_of_keys.hints(kind).values()))
        else:
            yield from chain.from_iterable(map(records, typing.get_args(kind)))


def bare(hint: Any) -> Iterator[Any]:
    """The numbers within a type that say neither unit nor range."""
    for kind, quantity in types_of_keys.find_quantities(hint):
        if kind in (float, int) and not quantity:
            yield kind
        elif typing.get_origin(kind) in (tuple, Mapping):
            yield from chain.from_iterable(map(bare, typing.get_args(kind)))


RECORDS = tuple(dict.fromkeys(records(Scene)))


def test_records_of_every_table_are_found():
    names = {record.__name__ for record in RECORDS}
    assert {"Body", "PDDrive", "Observer", "ArmHand", "VariableRate", "Latency", "Trace"} <= names


@pytest.mark.parametrize("record", RECORDS)
def test_every_key_has_a_meaning_and_every_number_a_quantity(record):
    meanings = key_descriptions.meanings(record)
    for name, hint in types_of_keys.hints(record).items():
        assert meanings[name].endswith("."), name
        assert not list(bare(hint)), name


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
    for kind, quantity in types_of_keys.find_quantities(hint):
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
                    types_of_keys.hints(kind)[key], getattr(value, field.name), (*path, key)
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
    if len(arguments) != len(value):
        return  # one of another length, as in space
    for i, (argument, each) in enumerate(zip(arguments, value, strict=True)):
        for number in numbers(argument, each, ()):
            yield Number(path, (i, *number.place), value, number.quantity, number.whole)


SCENES = tuple(find_scene.list_shipped())


def tables(name: str) -> dict[str, Any]:
    """What a shipped scene and those that it extends write."""
    return extends.document(find_scene.find_scene(name)[1], name, None)[0]


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


@cache
def validator():
    return jsonschema.Draft202012Validator(json_schema())


@settings(max_examples=150)
@given(st.data())
def test_numbers_of_shipped_scenes_out_of_range(data):
    name = data.draw(st.sampled_from(SCENES), "scene")
    number = data.draw(st.sampled_from(of_scene(name)), "number")
    value = data.draw(beyond(number), "value")
    option = f"{'.'.join(map(str, number.path))}={toml(put(number.value, number.place, value))}"
    with pytest.raises(SceneFault) as refused:
        read_and_check.from_source(Source(name, tables(name), {}, (option,)))
    found = {re.sub(r" \(\w+\)", "", f.key): f for f in refused.value.findings}
    finding = found[key(number)]
    assert shlex.split(finding.option) == ["--set", option]
    limits, unit = number.quantity.range, number.quantity.unit
    assert f"{value!r:.90} is out of range" in finding.message.replace("...", "")
    assert (limits if limits != "finite" else "finite number") in finding.message
    assert unit == "1" or f"({unit})" in finding.message
    if isinstance(value, str) or math.isinf(value) or math.isnan(value):
        return  # JSON has none of these, and a fraction no bound that a pattern could say
    written = tables(name)
    if "family" not in written["linkage"]:
        overrides.apply(written, option)
        assert not validator().is_valid(written)
