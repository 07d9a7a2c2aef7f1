"""What a process keeps from one run to the next, where it makes many that are alike."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any, Generic, TypeVar

Item = TypeVar("Item")
_keeping = 0
"""The contexts of `keep` that are open, in all threads."""
_lock = Lock()
_shelves: list[Shelf[Any]] = []


@contextmanager
def keep() -> Iterator[None]:
    """Within the context shelves keep what is put on them; behind the last of those that are open
    at the same time, in any thread, they are empty."""
    global _keeping
    with _lock:
        _keeping += 1
    try:
        yield
    finally:
        with _lock:
            _keeping -= 1
        for shelf in () if _keeping else _shelves:
            shelf.clear()


def is_keeping() -> bool:
    """Whether this process keeps things from run to run."""
    return _keeping > 0


class Shelf(Generic[Item]):
    """The newest items that were put on it, `most` of them; `close` ends those that fall off."""

    def __init__(self, most: int, close: Callable[[Item], object] = lambda item: None) -> None:
        self._most, self._close, self._lock = most, close, Lock()
        self._items: list[Item] = []
        _shelves.append(self)

    def take(self, fits: Callable[[Item], bool]) -> Item | None:
        """The newest item that fits, which is no longer on the shelf; None outside of `keep`."""
        with self._lock:
            items = reversed(self._items if _keeping else [])
            found = next((item for item in items if fits(item)), None)
            if found is not None:
                self._items = [item for item in self._items if item is not found]
            return found

    def put(self, item: Item) -> None:
        """Keep an item; where nothing is kept it ends at once."""
        with self._lock:
            self._items.append(item)
            most = self._most if _keeping else 0
            old = self._items[: max(len(self._items) - most, 0)]
            self._items = self._items[len(old) :]
        for each in old:
            self._close(each)

    def clear(self) -> None:
        """End all items."""
        with self._lock:
            old, self._items = self._items, []
        for each in old:
            self._close(each)

    def __len__(self) -> int:
        return len(self._items)
