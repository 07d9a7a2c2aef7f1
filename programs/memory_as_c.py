"""The memory of a run as C: each region of the loop's memory a field of a structure, with its
initial values and tables of its pointers."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from hapticlink.fmus.native.source import number
from hapticlink.orchestrator.run.compiled.regions import (
    APART,
    FUNCTIONS,
    NUMBERS,
    Region,
    Regions,
    find_embedded,
    is_structure,
    of_type,
    size,
    target,
)
from hapticlink.orchestrator.run.compiled.structures import POINTERS


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
