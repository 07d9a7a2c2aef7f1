"""The regions of the compiled loop's memory: every array that pointers reach from some structures
on, by what loop.h declares. Arrays that overlap, such as a vector and a view of it, are one."""

from __future__ import annotations

import ctypes
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.structures import POINTERS

NUMBERS: dict[str, Any] = {
    "double": ctypes.c_double,
    "int64_t": ctypes.c_int64,
    "uint64_t": ctypes.c_uint64,
    "int32_t": ctypes.c_int32,
    "int16_t": ctypes.c_int16,
    "uint32_t": ctypes.c_uint32,
}
FUNCTIONS = ("call", "do_step", "get_state", "set_state", "free_state")
"""Pointers to functions of an FMU."""
APART = (*FUNCTIONS, "fmu", "state")
"""Pointers that lead out of the memory of the run: into an FMU, or to where its state is saved."""


@dataclass(frozen=True)
class Region:
    """`count` entries of `type` from `address` on; `name` tells how it is reached."""

    type: str
    address: int
    count: int
    name: str

    @property
    def end(self) -> int:
        """The address behind its last entry."""
        return self.address + self.count * size(self.type)


def of_type(name: str) -> Any:
    """The ctypes class of a type of loop.h; that of a pointer for a name with a star."""
    if name.endswith("*"):
        return ctypes.c_void_p
    return NUMBERS.get(name) or getattr(structures, name)


def size(type_: str) -> int:
    """The bytes of an entry."""
    return ctypes.sizeof(of_type(type_))


def find_embedded(type_: str) -> Iterator[tuple[str, Any]]:
    """The fields of a structure that are no pointers, with their ctypes classes."""
    pointers = POINTERS.get(type_, {})
    yield from (f for f in of_type(type_)._fields_ if f[0] not in pointers)


def is_structure(type_: str) -> bool:
    """Whether a type is a structure of loop.h, and no number or pointer."""
    return type_ not in NUMBERS and not type_.endswith("*")


def target(type_: str, field: str, entry: Any) -> str:
    """The type that a pointer of a structure leads to: numbers as an FMU has them are doubles, or
    integers of 32 bits, which Booleans of FMI 2.0 are too."""
    pointer = POINTERS[type_][field]
    kind = pointer.type
    if kind == "void":
        kind = "double" if entry.kind.type == structures.DOUBLE else "int32_t"
    return kind + " *" * (pointer.stars - 1)


class Regions:
    """The regions that the structures at `roots` lead to, in the order in which they are reached.

    roots: name, type, address and count of each. counts: numbers of entries that no structure has a
    field for, by the names that loop.h uses. Raises AssertionError where memory of two types
    overlaps, which loop.h does not have.
    """

    def __init__(self, roots: list[tuple[str, str, int, int]], counts: Mapping[str, int]) -> None:
        self._reached: dict[tuple[str, int, int], Region] = {}
        self._counts = counts
        for name, type_, address, count in roots:
            self._visit(Region(type_, address, count, name), ())
        self.all = self._merged()
        self._sorted = sorted(self.all, key=lambda region: region.address)
        self._starts = [region.address for region in self._sorted]

    def entry_at(self, type_: str, address: int) -> tuple[Region, int] | None:
        """The region of an address with entries of a type, and the index of the entry there; None
        where there is no such region, as for arrays without entries."""
        first = bisect_right(self._starts, address) - 1
        if first < 0 or self._sorted[first].type != type_:
            return None
        index, rest = divmod(address - self._starts[first], size(type_))
        region = self._sorted[first]
        return None if rest or index >= region.count else (region, index)

    def _visit(self, region: Region, parents: tuple[Any, ...]) -> None:
        key = (region.type, region.address, region.count)
        if key in self._reached or not region.count:
            return
        self._reached[key] = region
        if region.type.endswith("*"):
            pointed = region.type[:-1].strip()
            for i, address in enumerate(
                (ctypes.c_void_p * region.count).from_address(region.address)
            ):
                if address:
                    name = f"{region.name.removesuffix('s')}_{i}"
                    self._visit(Region(pointed, address, 1, name), parents)
        elif is_structure(region.type):
            for i in range(region.count):
                entry = of_type(region.type).from_address(region.address + i * size(region.type))
                suffix = f"_{i}" if region.count > 1 else ""
                self._follow(region.type, entry, region.name + suffix, parents)

    def _follow(self, type_: str, entry: Any, name: str, parents: tuple[Any, ...]) -> None:
        """Visits what the pointers of a structure lead to."""
        known = (entry, *parents)
        for field, pointer in POINTERS.get(type_, {}).items():
            address = getattr(entry, field)
            if field in APART or not address:
                continue
            count = pointer.width * structures.evaluate(pointer.count, known, self._counts)
            kind = target(type_, field, entry)
            self._visit(Region(kind, address, count, f"{name}_{field}"), known)
        for field, class_ in find_embedded(type_):
            if issubclass(class_, ctypes.Structure):
                self._follow(class_.__name__, getattr(entry, field), f"{name}_{field}", known)

    def _merged(self) -> list[Region]:
        order = {key: i for i, key in enumerate(self._reached)}
        merged: list[tuple[int, Region]] = []
        for key, region in sorted(self._reached.items(), key=lambda item: item[1].address):
            if not merged or region.address >= merged[-1][1].end:
                merged.append((order[key], region))
                continue
            first, before = merged[-1]
            assert before.type == region.type, (before, region)
            count = (max(before.end, region.end) - before.address) // size(region.type)
            name = before.name if first < order[key] else region.name
            merged[-1] = min(first, order[key]), replace(before, count=count, name=name)
        return [region for _, region in sorted(merged, key=lambda item: item[0])]
