"""Copies values between a vector and an FMU, with one C call per FMI type.

A String or Binary is in a signal vector as its number, a hash of its bytes: so it is held, delayed,
saved and passed on as a number is, the same in each run, and what an FMU gets are the bytes.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from hashlib import sha256
from itertools import groupby
from types import MappingProxyType
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.fmi.start_values import WIDE, Given
from hapticlink.orchestrator.fmi.status import succeeded
from hapticlink.orchestrator.fmi.variables import WRITTEN, Scalar

_IN_C: dict[str, type[np.generic]] = {
    "Real": np.float64, "Integer": np.int32,
    "Float64": np.float64, "Float32": np.float32,
    "Int64": np.int64, "Int32": np.int32, "Int16": np.int16, "Int8": np.int8,
    "UInt64": np.uint64, "UInt32": np.uint32, "UInt16": np.uint16, "UInt8": np.uint8,
}  # fmt: skip
_BOOLEAN = {"2": np.int32, "3": np.bool_}  # fmi2Boolean is an int, fmi3Boolean a bool

_TEXTS: dict[float, bytes] = {0: b""}
_LOCK = threading.Lock()
NUMBER = 6
"""Bytes of the number of a text, which a double holds exactly."""
_followers: list[Callable[[int, bytes], object]] = []


class Unfit(ValueError):
    """A number that its FMI type cannot hold."""


class Transfer:
    """The scalars of one FMI type within a vector, and the C call that moves them.

    Entries of an FMI 3.0 array are transferred together, so they have to be adjacent and complete.
    exact: integers, by name, to set instead of the values, which are doubles. function, component
    and references are the arguments of the call, `buffer` its values as the FMU has them: `values`
    themselves where these are doubles.
    """

    def __init__(
        self,
        slave: Any,
        fmi: str,
        verb: str,
        scalars: Sequence[Scalar],
        values: Vector,
        exact: Mapping[str, int],
    ) -> None:
        self.values, self.type, self.fmi = values, (type_ := scalars[0].type), fmi
        self.name = f"fmi{fmi}{verb}{type_}"
        in_c = _IN_C.get(type_) or _BOOLEAN[fmi]
        self._boolean, self._whole = type_ == "Boolean", np.issubdtype(in_c, np.integer)
        if self._whole:
            self._limits = np.iinfo(in_c)
            self._named = f"{type_} holds {self._limits.min} to {self._limits.max}"
            self._names = [s.name for s in scalars]
        self.exact = [
            (k, exact[s.name]) for k, s in enumerate(scalars) if type_ in WIDE and s.name in exact
        ]
        self._wide = type_ in WIDE
        direct = in_c is np.float64
        self.buffer: Any = self.values if direct else np.zeros(len(values), in_c)
        references = [s.reference for s in scalars if s.entry == 0]
        count = [ctypes.c_size_t(len(values))] * (fmi == "3")
        self.function, self.component = slave.dll[self.name], slave.component
        self.references = (ctypes.c_uint * len(references))(*references)
        # Argument objects and pointers are made once; a fresh function has no other types set.
        self._transfer: Callable[[], int] = partial(
            self.function,
            ctypes.c_void_p(slave.component),
            self.references,
            ctypes.c_size_t(len(references)),
            ctypes.c_void_p(self.buffer.ctypes.data),
            *count,
        )
        through = {"Get": self._get, "Set": self._set}[verb]
        self.call: Callable[[], int] = self._transfer if direct else through

    def _get(self) -> int:
        """Raises Unfit for an integer that is not exactly representable as a double."""
        status = self._transfer()
        self.values[:] = self.buffer
        if self._wide:
            for name, whole, value in zip(self._names, self.buffer, self.values, strict=True):
                if int(whole) != int(value):
                    what = "which signals and results, of double precision, cannot hold"
                    raise Unfit(f"{name} is {int(whole)}, {what}")
        return status

    def _set(self) -> int:
        for k, _ in self.exact:
            self.values[k] = 0.0
        if self._boolean:
            self.buffer[:] = self.values >= 0.5
        else:
            self.buffer[:] = self._rounded() if self._whole else self.values
        for k, whole in self.exact:
            if not self._limits.min <= whole <= self._limits.max:
                raise Unfit(f"{self._names[k]} cannot be {whole}: {self._named}")
            self.buffer[k] = whole
        return self._transfer()

    def _rounded(self) -> Vector:
        """The nearest integers. Raises Unfit for values beyond the range of the type."""
        rounded, limits = np.rint(self.values), self._limits
        # max + 1 is a power of two, so it is exact where max is not.
        fits = (rounded >= limits.min) & (rounded < float(limits.max + 1))
        if not fits.all():
            i = int(np.argmin(fits))
            value = float(self.values[i])
            raise Unfit(f"{self._names[i]} cannot be {value!r}: {self._named}")
        return rounded


def as_signal(scalar: Scalar, value: Given) -> float:
    """A start value as a signal has it."""
    if isinstance(value, str):
        text = bytes.fromhex(value) if scalar.type == "Binary" else value.encode()
        return float(number_of(text))
    return float(value)


def number_of(text: bytes) -> int:
    """The number of a text, by which it is known from now on."""
    number = int.from_bytes(sha256(text).digest()[:NUMBER]) if text else 0
    with _LOCK:
        while _TEXTS.get(number, text) != text:  # two in some 10^7 texts
            number += 1
        if number not in _TEXTS:
            _TEXTS[number] = text
            for follower in _followers:
                follower(number, text)
    return number


def text_of(number: float, name: str) -> bytes:
    """The text of a signal's number. Raises Unfit where it is that of none, as in a state that was
    changed."""
    if (text := _TEXTS.get(number)) is None:
        raise Unfit(f"{name} cannot be {number:.17g}, the number of no text")
    return text


def known_texts(numbers: Iterable[float]) -> dict[int, bytes]:
    """Those of the numbers that are texts of this process, in their order, each once."""
    with _LOCK:
        return {int(n): _TEXTS[n] for n in dict.fromkeys(numbers) if n in _TEXTS}


def follow_texts(follower: Callable[[int, bytes], object]) -> None:
    """Tells `follower` all texts of this process, those to come when it meets them first."""
    with _LOCK:
        for number, known in _TEXTS.items():
            follower(int(number), known)
        _followers.append(follower)


def leave_texts(follower: Callable[[int, bytes], object]) -> None:
    """Tells it no more, if it was told."""
    with _LOCK:
        _followers[:] = [each for each in _followers if each != follower]


def shown(text: bytes, type_: str) -> str:
    """A text of an FMI type as tables have it: a Binary in hexadecimal digits."""
    return text.hex() if type_ == "Binary" else text.decode(errors="backslashreplace")


class TextTransfer:
    """The Strings or Binaries of a get or a set, called as a `Transfer`."""

    exact = ()

    def __init__(
        self, slave: Any, fmi: str, verb: str, scalars: Sequence[Scalar], values: Vector
    ) -> None:
        self._names = [s.name for s in scalars]
        of, type_ = [s.reference for s in scalars if s.entry == 0], scalars[0].type
        n, size = ctypes.c_size_t(len(of)), len(scalars)
        self.name, self._values, self._gets = f"fmi{fmi}{verb}{type_}", values, verb == "Get"
        self._function, self._is_binary = slave.dll[self.name], type_ == "Binary"
        self._texts = (ctypes.c_char_p * size)()
        self._sizes = (ctypes.c_size_t * size)()
        references = (ctypes.c_uint * n.value)(*of)
        binary, three = [self._sizes] * self._is_binary, [ctypes.c_size_t(size)] * (fmi == "3")
        own = ctypes.c_void_p(slave.component)
        self._arguments = [own, references, n, *binary, self._texts, *three]

    def call(self) -> int:
        if not self._gets:
            for i, number in enumerate(self._values):
                self._texts[i] = text = text_of(number, self._names[i])
                self._sizes[i] = len(text)
        status: int = self._function(*self._arguments)
        if self._gets and succeeded(status):
            starts = ctypes.cast(self._texts, ctypes.POINTER(ctypes.c_void_p))
            for i, size in enumerate(self._sizes):
                text = ctypes.string_at(starts[i], size) if size else self._texts[i] or b""
                self._values[i] = number_of(b"" if self._is_binary and not size else text)
        return status


def transfers(
    slave: Any,
    fmi: str,
    verb: str,
    scalars: Sequence[Scalar],
    values: Vector,
    exact: Mapping[str, int] = MappingProxyType({}),
    places: Sequence[int] | None = None,
) -> list[Transfer]:
    """One transfer per FMI type. `scalars` are sorted by type, those of a type side by side at
    their `places` in `values`, by default from the first on."""
    several: list[Any] = []
    end = 0
    for type_, same in groupby(scalars, lambda s: s.type):
        of_type = [*same]
        begin, end = end, end + len(of_type)
        first, last = (i if places is None else places[i] for i in (begin, end - 1))
        own = values[first : last + 1]
        if type_ in WRITTEN:
            several.append(TextTransfer(slave, fmi, verb, of_type, own))
        else:
            several.append(Transfer(slave, fmi, verb, of_type, own, exact))
    return several
