"""Every key of a scene has a meaning, and every number a unit and a range."""

import typing
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from itertools import chain
from typing import Any

import pytest

from hapticlink.orchestrator.scene import key_descriptions, schema
from hapticlink.orchestrator.scene.scene import Scene


def records(hint: Any) -> Iterator[Any]:
    """Every record that is reached from a type."""
    for kind in schema.branches(hint):
        if is_dataclass(kind):
            yield kind
            yield from chain.from_iterable(map(records, schema.hints(kind).values()))
        else:
            yield from chain.from_iterable(map(records, typing.get_args(kind)))


def bare(hint: Any) -> Iterator[Any]:
    """The numbers within a type that say neither unit nor range."""
    for kind, quantity in schema.measured(hint):
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
    for name, hint in schema.hints(record).items():
        assert meanings[name].endswith("."), name
        assert not list(bare(hint)), name
