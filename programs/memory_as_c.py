"""The memory of a run as C: every array that pointers reach from the first structure of the C loop
on is a region, and each region a field of a structure, with its initial values and tables of its
pointers. Arrays that overlap, such as a vector and a view of it, are one."""

from __future__ import annotations

import ctypes
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from hapticlink.fmus.native.source import number
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
    """`count` entries of `type` from `address` on; `name` is its field in the program's data."""

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


class TypedData:
    """C of the regions of a run.

    members: index of each FMU, by the address of its component. functions: what the FMI functions
    are called in `calls`, by address.

    `structure` declares `Scene`, `values` is its initialiser, `pointers` has pairs of places in it
    (the pointer, and what it leads to), `handles` the places of components with the member's index,
    `calls` those of functions with the member's index and what they are called, `slots` those of
    where states are saved, with the member's index.
    """

    def __init__(
        self, regions: Regions, members: Mapping[int, int], functions: Mapping[int, str]
    ) -> None:
        self._regions, self._members, self._functions = regions, members, functions
        self.pointers: list[tuple[str, str]] = []
        self.handles: list[tuple[str, int]] = []
        self.calls: list[tuple[str, int, str]] = []
        self.slots: list[tuple[str, int]] = []
        self._of_check: dict[int, int] = {}
        fields = [f"    {_declare(region)};" for region in regions.all]
        self.structure = "\n".join(["typedef struct {", *fields, "} Scene;"])
        values = ((region, self._initial(region)) for region in regions.all)
        rows = [f"    .{region.name} = {text}," for region, text in values if text != "{0}"]
        self.values = "\n".join(["{", *rows, "}"])

    def _initial(self, region: Region) -> str:
        if region.type.endswith("*"):
            self._array_of_pointers(region)
            return "{0}"
        if not is_structure(region.type):
            return _write_initialiser(_numbers(region.type, region.address, region.count))
        entries = []
        for i in range(region.count):
            entry = of_type(region.type).from_address(region.address + i * size(region.type))
            entries.append(self._structure(region.type, entry, _place(region, i), None))
        return entries[0] if region.count == 1 else _write_initialiser(entries, "{0}")

    def _array_of_pointers(self, region: Region) -> None:
        addresses = (ctypes.c_void_p * region.count).from_address(region.address)
        for i, address in enumerate(addresses):
            if address:
                there = self._regions.entry_at(region.type[:-1].strip(), address)
                assert there
                self.pointers.append((_place(region, i, True), _place(*there)))

    def _structure(self, type_: str, entry: Any, place: str, member: int | None) -> str:
        """The initialiser of a structure at `place`, whose pointers are noted."""
        pointers = POINTERS.get(type_, {})
        if getattr(entry, "fmu", None):
            member = self._members[entry.fmu]
        if type_ == "Check":
            member = self._of_check[ctypes.addressof(entry)]
        for field in pointers:
            if getattr(entry, field):
                self._pointer(type_, field, entry, f"{place}.{field}", member)
        rows = []
        for field, class_ in find_embedded(type_):
            value = getattr(entry, field)
            if issubclass(class_, ctypes.Structure):
                text = self._structure(class_.__name__, value, f"{place}.{field}", member)
            elif issubclass(class_, ctypes.Array):
                suffix = "u" if class_._type_ is ctypes.c_uint64 else ""
                text = _write_initialiser(f"{entry}{suffix}" if entry else "0" for entry in value)
            else:
                text = number(value) if class_ is ctypes.c_double else str(value)
            if text not in ("0", "0.0", "{0}") and (type_, field) != ("Kind", "python"):
                rows.append(f".{field} = {text}")
        return f"{{{', '.join(rows) or '0'}}}"

    def _pointer(self, type_: str, field: str, entry: Any, place: str, member: int | None) -> None:
        address = getattr(entry, field)
        if field not in APART:
            kind = target(type_, field, entry)
            there = self._regions.entry_at(kind, address)
            if there is None:
                return
            if kind == "Check":
                assert member is not None
                self._of_check[address] = member
            self.pointers.append((place, _place(*there)))
            return
        assert member is not None
        if field == "fmu":
            self.handles.append((place, member))
        elif field in FUNCTIONS:
            self.calls.append((place, member, self._functions[address]))
        else:
            self.slots.append((place, member))


def _declare(region: Region) -> str:
    pointers = region.type.count("*")
    several = f"[{region.count}]" if _is_array(region) else ""
    return f"{region.type.rstrip(' *')} {'*' * pointers}{region.name}{several}"


def _is_array(region: Region) -> bool:
    return region.count > 1 or not is_structure(region.type)


def _place(region: Region, index: int, pointer: bool = False) -> str:
    return f"{region.name}[{index}]" if pointer or _is_array(region) else region.name


def _numbers(type_: str, address: int, count: int) -> Iterator[str]:
    values = (NUMBERS[type_] * count).from_address(address)
    return map(number if type_ == "double" else str, values)


def _write_initialiser(entries: Iterable[str], zero: str = "") -> str:
    """A C initialiser, without the zeros at its end, which C fills in."""
    rows, none = [*entries], {"0", "0.0", zero}
    while rows and rows[-1] in none:
        rows.pop()
    return f"{{{', '.join(rows) or '0'}}}"
