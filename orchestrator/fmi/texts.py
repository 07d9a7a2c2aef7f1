"""Texts and bytes in a signal vector: each as its number among those that this process has met.

So a String or Binary that is connected is held, delayed and passed on as a number is, and what an
FMU gets are the bytes.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Sequence
from typing import Any

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.fmi.status import succeeded
from hapticlink.orchestrator.fmi.variables import Scalar

_TEXTS = [b""]
_NUMBERS = {b"": 0}
_LOCK = threading.Lock()


def number_of(text: bytes) -> int:
    with _LOCK:
        if text not in _NUMBERS:
            _NUMBERS[text] = len(_TEXTS)
            _TEXTS.append(text)
        return _NUMBERS[text]


class TextTransfer:
    """The Strings or Binaries of a get or a set, called as a `transfer.Transfer`."""

    exact = ()

    def __init__(
        self, slave: Any, fmi: str, verb: str, scalars: Sequence[Scalar], values: Vector
    ) -> None:
        n, type_ = ctypes.c_size_t(len(scalars)), scalars[0].type
        self.name, self._values, self._gets = f"fmi{fmi}{verb}{type_}", values, verb == "Get"
        self._function, self._is_binary = slave.dll[self.name], type_ == "Binary"
        self._texts = (ctypes.c_char_p * n.value)()
        self._sizes = (ctypes.c_size_t * n.value)()
        references = (ctypes.c_uint * n.value)(*(s.reference for s in scalars))
        binary, three = [self._sizes] * self._is_binary, [n] * (fmi == "3")
        own = ctypes.c_void_p(slave.component)
        self._arguments = [own, references, n, *binary, self._texts, *three]

    def call(self) -> int:
        if not self._gets:
            for i, number in enumerate(self._values):
                self._texts[i] = text = _TEXTS[round(number)]
                self._sizes[i] = len(text)
        status: int = self._function(*self._arguments)
        if self._gets and succeeded(status):
            starts = ctypes.cast(self._texts, ctypes.POINTER(ctypes.c_void_p))
            for i, size in enumerate(self._sizes):
                text = ctypes.string_at(starts[i], size) if size else self._texts[i] or b""
                self._values[i] = number_of(b"" if self._is_binary and not size else text)
        return status
