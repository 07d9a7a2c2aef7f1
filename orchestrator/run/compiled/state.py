"""The state of a hold or an energy tank as one block: its numbers and its whole numbers (stamps,
counts), copied and restored by what loop.h declares as state, whatever that is. Of the hold of a
plugin, which loop.h does not know, they are the attributes."""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds.hold import Hold
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.structures import POINTERS, STATE

Integers = NDArray[np.int64]
WORD = 8
"""Bytes of each number."""


@dataclass(frozen=True)
class Saved:
    """A state that was copied. lengths: of the arrays of its numbers; own: the attributes of a
    plugin's hold."""

    integers: Integers
    numbers: Vector
    lengths: tuple[int, ...]
    own: dict[str, Any]


@dataclass(frozen=True)
class Array:
    """`n` entries of 8 bytes at an address, or as many as `used` says in fields of the structures
    `of`."""

    name: str
    address: int
    n: int
    used: str | None = None
    of: tuple[Any, ...] = ()

    @property
    def length(self) -> int:
        return self.n if self.used is None else structures.evaluate(self.used, self.of)

    def name_entries(self, length: int) -> Iterator[str]:
        if length == 1 and self.used is None:
            yield self.name
        else:
            yield from (f"{self.name}[{i + 1}]" for i in range(length))


class StateBlock:
    """The state of a structure of loop.h with all that it owns, and of the hold of a plugin that it
    calls back."""

    def __init__(self, c: Any, own: Callable[[], Hold | None] = lambda: None) -> None:
        self._c, self._own = c, own
        self._rooms: list[int] = []
        self._integers: list[Array] = []
        self._numbers: list[Array] = []

    def integers(self) -> Integers:
        """The whole numbers of the state as it is."""
        if self._own():
            return self.save().integers
        self._locate()
        return np.frombuffer(_read(self._integers), np.int64)

    def save(self) -> Saved:
        self._locate()
        lengths = tuple(array.length for array in self._numbers)
        integers = np.frombuffer(_read(self._integers), np.int64)
        numbers = np.frombuffer(_read(self._numbers))
        if not (own := self._own()):
            return Saved(integers, numbers, lengths, {})
        floats, whole = [numbers], [*integers.tolist()]

        def note(value: Vector) -> Vector:
            floats.append(value.ravel())
            return value.copy()

        attributes = _copied(vars(own), note, whole.append)
        every = np.concatenate(floats)
        lengths = (*lengths, len(every) - len(numbers))
        return Saved(np.array(whole, np.int64), every, lengths, attributes)

    def restore(self, saved: Saved, numbers: Vector) -> None:
        """Takes on a state that was saved, with these numbers in the place of its own."""
        self._locate()
        first = _write(self._integers, saved.integers)  # they say how many numbers there are
        assert saved.own or first == len(saved.integers)
        at = _write(self._numbers, numbers)
        assert saved.own or at == len(numbers)

        def take(value: Vector) -> Vector:
            nonlocal at
            at += value.size
            return numbers[at - value.size : at].reshape(value.shape).copy()

        if own := self._own():
            vars(own).update(_copied(saved.own, take, lambda whole: None))

    def names(self, saved: Saved) -> Iterator[str]:
        """What each of the numbers of a saved state is."""
        arrays = [*self._numbers, Array("own", 0, 0, "")]
        for array, length in zip(arrays, saved.lengths, strict=False):
            yield from array.name_entries(length)

    def _locate(self) -> None:
        """Finds the arrays, anew where one has grown."""
        if self._rooms != (rooms := [*_rooms(self._c)]):
            self._rooms, found = rooms, [*_arrays(self._c, "", ())]
            self._integers = [array for is_whole, array in found if is_whole]
            self._numbers = [array for is_whole, array in found if not is_whole]


def _rooms(c: Any) -> Iterator[int]:
    """The rooms of what grows."""
    for field in ("link", "account"):
        if address := getattr(c, field, None):
            yield getattr(structures, field.title()).from_address(address).room
    yield ctypes.addressof(c)


def _arrays(c: Any, path: str, owners: tuple[Any, ...]) -> Iterator[tuple[bool, Array]]:
    """The arrays of the state of a structure, each with whether it is of whole numbers."""
    class_, known = type(c), (c, *owners)
    declared, pointers = dict(class_._fields_), POINTERS.get(class_.__name__, {})
    for field in STATE.get(class_.__name__, ()):
        name, pointer, type_ = f"{path}{field}", pointers.get(field), declared[field]
        if pointer is None and issubclass(type_, ctypes.Structure):
            yield from _arrays(getattr(c, field), f"{name}.", known)
        elif pointer is None:
            place = ctypes.addressof(c) + getattr(class_, field).offset
            is_whole = not issubclass(type_, ctypes.c_double)
            yield is_whole, Array(name, place, ctypes.sizeof(type_) // WORD)
        elif not (address := getattr(c, field)):
            continue
        elif pointer.type not in ("double", "int64_t"):
            owned = getattr(structures, pointer.type).from_address(address)
            yield from _arrays(owned, f"{name}.", known)
        elif pointer.used == pointer.count:
            n = structures.evaluate(pointer.count, known)
            yield pointer.type == "int64_t", Array(name, address, n)
        else:
            yield pointer.type == "int64_t", Array(name, address, 0, pointer.used, known)


def _read(arrays: Sequence[Array]) -> bytes:
    return b"".join([ctypes.string_at(a.address, WORD * a.length) for a in arrays])


def _write(arrays: Sequence[Array], values: NDArray[Any]) -> int:
    """Writes the first of `values` to arrays; how many they have taken."""
    content, first = values.tobytes(), 0
    for array in arrays:
        size = WORD * array.length
        ctypes.memmove(array.address, content[first : first + size], size)
        first += size
    return first // WORD


def _copied(value: Any, number: Callable[[Vector], Vector], whole: Callable[[int], object]) -> Any:
    """A copy of the attributes of a plugin's hold: of containers, arrays and holds in them, with
    `number` applied to every number that is a float, and each integer told to `whole`."""
    match value:
        case bool() | str() | None:
            return value
        case int():
            whole(value)
            return value
        case np.ndarray():
            return number(value) if value.dtype.kind == "f" else value.copy()
        case float():
            return float(number(np.array(value)))
        case dict():
            return {k: _copied(v, number, whole) for k, v in value.items()}
        case list() | tuple():
            return type(value)(_copied(v, number, whole) for v in value)
        case deque():
            return deque((_copied(v, number, whole) for v in value), value.maxlen)
        case Hold():
            other = type(value).__new__(type(value))
            vars(other).update(_copied(vars(value), number, whole))
            return other
    return value if callable(value) else deepcopy(value)
