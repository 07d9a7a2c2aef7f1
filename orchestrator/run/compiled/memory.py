"""Memory of what the compiled loop reads at each step, in the order in which it is asked for: what
an operation reads lies in few cache lines, and the next operation's behind them."""

from __future__ import annotations

import ctypes
from typing import Any

LINE = 64
"""Bytes of a cache line."""
BLOCK = 1 << 16


class Memory:
    """Rooms in blocks of memory, which live as long as this object."""

    def __init__(self) -> None:
        self._blocks: list[Any] = []
        self._next = self._end = 0

    def room(self, size: int) -> int:
        """The address of `size` bytes, zeros, from the beginning of a cache line on."""
        whole = -(-size // LINE) * LINE
        if self._next + whole > self._end:
            block = ctypes.create_string_buffer(max(BLOCK, whole) + LINE)
            self._blocks.append(block)
            self._next = -(-ctypes.addressof(block) // LINE) * LINE
            self._end = ctypes.addressof(block) + len(block)
        address, self._next = self._next, self._next + whole
        return address

    def copy(self, array: Any) -> int:
        """The address of a copy of an array."""
        content = memoryview(array).cast("B")
        address = self.room(len(content))
        ctypes.memmove(address, content.tobytes(), len(content))
        return address
