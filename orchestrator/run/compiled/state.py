"""The state of a hold or an energy tank as one block: its numbers and its whole numbers (stamps,
counts), copied and restored by what loop.h declares as state, whatever that is. Of the hold of a
plugin, which loop.h does not know, they are the attributes."""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
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
    """A state that was copied. counts: which say how long its arrays are, and lengths: of those of
    its numbers; own: the attributes of a plugin's hold."""

    integers: Integers
    numbers: Vector
    counts: tuple[int, ...]
    lengths: tuple[int, ...]
    own: dict[str, Any]


@dataclass(frozen=True)
class Array:
    """`n` entries of 8 bytes at an address, or as many as `used` says in fields of the structures
    `of`."""

    name: str
    address: int
    is_whole: bool
    n: int
    used: str | None = None
    of: tuple[Any, ...] = ()

    @property
    def length(self) -> int:
        return self.n if self.used is None else structures.evaluate(self.used, self.of)

    @property
    def view(self) -> NDArray[Any]:
        """Its entries, as many as there are now."""
        kind: Any = ctypes.c_int64 if self.is_whole else ctypes.c_double
        return np.ctypeslib.as_array((kind * self.length).from_address(self.address))

    @property
    def counters(self) -> Iterator[Integers]:
        """The numbers of the state that say how many there are."""
        for name in structures.names(self.used or ""):
            owner = next(each for each in self.of if hasattr(each, name))
            if name in STATE[type(owner).__name__]:
                place = ctypes.addressof(owner) + getattr(type(owner), name).offset
                yield Array(name, place, True, 1).view

    def name_entries(self, length: int) -> Iterator[str]:
        if length == 1 and self.used is None:
            yield self.name
        else:
            yield from (f"{self.name}[{i + 1}]" for i in range(length))


@dataclass(frozen=True)
class _Views:
    """The arrays of a state while they have these counts, and its numbers these lengths."""

    integers: list[Integers]
    numbers: list[Vector]
    counts: tuple[int, ...]
    lengths: tuple[int, ...]


class StateBlock:
    """The state of a structure of loop.h with all that it owns, and of the hold of a plugin that it
    calls back."""

    def __init__(self, c: Any, own: Callable[[], Hold | None] = lambda: None) -> None:
        self._c, self._own = c, own
        self._rooms: list[int] = []
        self._arrays: list[Array] = []
        self._counters: list[Integers] = []
        self._known: dict[tuple[int, ...], _Views] = {}

    def integers(self) -> Integers:
        """The whole numbers of the state as it is."""
        return self.save().integers if self._own() else _joined(self._now().integers, np.int64)

    def numbers(self) -> Vector:
        """Its other numbers."""
        return self.save().numbers if self._own() else _joined(self._now().numbers, float)

    def save(self) -> Saved:
        views = self._now()
        integers, numbers = _joined(views.integers, np.int64), _joined(views.numbers, float)
        if not (own := self._own()):
            return Saved(integers, numbers, views.counts, views.lengths, {})
        floats, whole = [numbers], [*integers.tolist()]

        def note(value: Vector) -> Vector:
            floats.append(value.ravel())
            return value.copy()

        attributes = _copied(vars(own), note, whole.append)
        every = np.concatenate(floats)
        lengths = (*views.lengths, len(every) - len(numbers))
        return Saved(np.array(whole, np.int64), every, views.counts, lengths, attributes)

    def restore(self, saved: Saved, numbers: Vector) -> None:
        """Takes on a state that was saved, with these numbers in the place of its own."""
        self._locate()
        for counter, count in zip(self._counters, saved.counts, strict=True):
            counter[0] = count
        views = self._views(saved.counts)
        first = _write(views.integers, saved.integers)
        assert saved.own or first == len(saved.integers)
        at = _write(views.numbers, numbers)
        assert saved.own or at == len(numbers)

        def take(value: Vector) -> Vector:
            nonlocal at
            at += value.size
            return numbers[at - value.size : at].reshape(value.shape).copy()

        if own := self._own():
            vars(own).update(_copied(saved.own, take, lambda whole: None))

    def names(self, saved: Saved) -> Iterator[str]:
        """What each of the numbers of a saved state is."""
        arrays = [array for array in self._arrays if not array.is_whole]
        for array, length in zip(
            [*arrays, Array("own", 0, False, 0, "")], saved.lengths, strict=False
        ):
            yield from array.name_entries(length)

    def _locate(self) -> None:
        """Finds the arrays, anew where one has grown."""
        if self._rooms != (rooms := [*_rooms(self._c)]):
            self._rooms, self._arrays = rooms, [*_arrays(self._c, "", ())]
            self._counters = [each for array in self._arrays for each in array.counters]
            self._known = {}

    def _now(self) -> _Views:
        """Of the arrays as they are."""
        self._locate()
        return self._views(tuple([int(counter[0]) for counter in self._counters]))

    def _views(self, counts: tuple[int, ...]) -> _Views:
        """Of the arrays while the counters have these values, which they have now."""
        if counts not in self._known:
            whole = _views(array for array in self._arrays if array.is_whole)
            others = [array for array in self._arrays if not array.is_whole]
            lengths = tuple(array.length for array in others)
            self._known[counts] = _Views(whole, _views(others), counts, lengths)
        return self._known[counts]


def _rooms(c: Any) -> Iterator[int]:
    """The rooms of what grows."""
    for field in ("link", "account"):
        if address := getattr(c, field, None):
            yield getattr(structures, field.title()).from_address(address).room
    yield ctypes.addressof(c)


def _arrays(c: Any, path: str, owners: tuple[Any, ...]) -> Iterator[Array]:
    """The arrays of the state of a structure."""
    class_, known = type(c), (c, *owners)
    declared, pointers = dict(class_._fields_), POINTERS.get(class_.__name__, {})
    for field in STATE.get(class_.__name__, ()):
        name, pointer, type_ = f"{path}{field}", pointers.get(field), declared[field]
        if pointer is None and issubclass(type_, ctypes.Structure):
            yield from _arrays(getattr(c, field), f"{name}.", known)
        elif pointer is None:
            place = ctypes.addressof(c) + getattr(class_, field).offset
            is_whole = not issubclass(type_, ctypes.c_double)
            yield Array(name, place, is_whole, ctypes.sizeof(type_) // WORD)
        elif not (address := getattr(c, field)):
            continue
        elif pointer.type not in ("double", "int64_t"):
            owned = getattr(structures, pointer.type).from_address(address)
            yield from _arrays(owned, f"{name}.", known)
        elif pointer.used == pointer.count:
            n = structures.evaluate(pointer.count, known)
            yield Array(name, address, pointer.type == "int64_t", n)
        else:
            yield Array(name, address, pointer.type == "int64_t", 0, pointer.used, known)


def _views(arrays: Iterable[Array]) -> list[NDArray[Any]]:
    """The entries of arrays of one kind, in their order; of neighbours in memory as one, since a
    view costs more than its entries."""
    runs: list[Array] = []
    for array in arrays:
        if runs and runs[-1].address + WORD * runs[-1].n == array.address:
            runs[-1] = replace(runs[-1], n=runs[-1].n + array.length)
        else:
            runs.append(replace(array, n=array.length, used=None))
    return [run.view for run in runs if run.n]


def _joined(views: Sequence[NDArray[Any]], kind: type) -> NDArray[Any]:
    return np.concatenate(views) if views else np.zeros(0, kind)


def _write(views: Sequence[NDArray[Any]], values: NDArray[Any]) -> int:
    """Writes the first of `values` to arrays; how many they have taken."""
    first = 0
    for view in views:
        view[:] = values[first : first + len(view)]
        first += len(view)
    return first


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
