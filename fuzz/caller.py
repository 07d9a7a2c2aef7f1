"""Random calls of the C interface of one FMU (FMI 2.0.5), in any order and with any arguments that
an importer can pass by mistake: unknown value references, null pointers, times that are not finite,
damaged states. What no FMU can see is left out: freed instances, arrays shorter than their count.

The library takes this process with it where it crashes, so nothing but the standard library is
loaded:  python caller.py '{"library": ..., }'  with the fields of `Target`.
"""

from __future__ import annotations

import ctypes
import json
import math
import mmap
import random
import sys
from collections.abc import Callable
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TOLD = 1000
"""Bytes in which the call that runs stands, for whoever finds the process dead."""
TIMES = (math.nan, math.inf, -math.inf, 1e308, -1.0, 0.0, 5e-324)
REFERENCES = (2**31 - 1, 2**31, 2**32 - 1)
TYPES = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
NAMES = (b"one", b"", b"x" * 20_000, "r\u00fcck".encode(), b"%s%n%n")


@dataclass(frozen=True)
class Target:
    """reals are 0 to reals - 1. pointers: null ones are passed, as the FMU looks at them."""

    library: str
    guid: str
    resources: str
    reals: int
    pointers: bool
    told: str
    seed: int
    calls: int


class Callbacks(ctypes.Structure):
    _fields_ = [(n, c_void_p) for n in ("logger", "allocate", "free", "finished", "environment")]


LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


class Caller:
    """Instances and states of an FMU, and the calls that may come next."""

    def __init__(self, target: Target, told: mmap.mmap) -> None:
        self.target, self.told, self.draw = target, told, random.Random(target.seed)
        self.dll = ctypes.CDLL(target.library)
        self.instances: list[c_void_p] = []
        self.states: list[tuple[c_void_p, c_void_p]] = []
        self.time = 0.0
        self.messages = 0
        libc = ctypes.CDLL(None)
        self._logger = LOGGER(self._log)
        self._callbacks = Callbacks(
            *(ctypes.cast(f, c_void_p).value for f in (self._logger, libc.calloc, libc.free))
        )
        self.dll.fmi2Instantiate.restype = c_void_p
        self.likely: tuple[Callable[[], None], ...] = (
            self.step, self.get_real, self.set_real, self.initialize, self.state,
        )  # fmt: skip
        self.all = (
            *self.likely, self.instantiate, self.free, self.mode, self.other_type, self.status,
            self.bytes_of_a_state, self.derivatives, self.free_state,
        )  # fmt: skip

    def _log(self, environment: object, name: bytes, status: int, category: bytes, text: bytes):
        assert 0 <= status <= 5, status
        self.messages += len(text) > 0

    def run(self) -> None:
        for _ in range(self.target.calls):
            if not self.instances:
                self.instantiate(well=True)
            self.draw.choice(self.likely if self.draw.random() < 0.6 else self.all)()
        while self.instances:
            self.free()

    def call(self, name: str, *arguments: Any) -> Any:
        self.told[:] = f"{name} {arguments!r}".encode()[:TOLD].ljust(TOLD)
        status = getattr(self.dll, name)(*arguments)
        assert name == "fmi2Instantiate" or 0 <= status <= 5, status
        return status

    # --- arguments ------------------------------------------------------------------------

    def _rarely(self, often: float = 0.03) -> bool:
        return self.draw.random() < often

    def _instance(self) -> c_void_p:
        return self._or_null(self.draw.choice(self.instances))

    def _or_null(self, pointer: Any) -> Any:
        return None if self.target.pointers and self._rarely() else pointer

    def _time(self, usual: float) -> c_double:
        return c_double(self.draw.choice(TIMES) if self._rarely(0.1) else usual)

    def _array(self, kind: Any, values: list[Any]) -> Any:
        return self._or_null((kind * len(values))(*values))

    def _references(self) -> list[int]:
        first, count = self.draw.randrange(self.target.reals + 1), self.draw.randrange(9)
        found = [self.draw.randrange(self.target.reals) for _ in range(count)]
        if self._rarely(0.3):
            found = [i % self.target.reals for i in range(first, first + count)]
        if found and self._rarely(0.1):
            some = (self.target.reals, *REFERENCES)
            found[self.draw.randrange(count)] = self.draw.choice(some)
        return found

    def _real(self) -> float:
        return self.draw.choice(TIMES) if self._rarely(0.1) else self.draw.gauss(0.0, 2.0)

    # --- calls ----------------------------------------------------------------------------

    def instantiate(self, well: bool = False) -> None:
        guid, name, kind, callbacks = self.target.guid.encode(), b"one", 1, self._callbacks
        if not well and self._rarely(0.5):
            guid = self.draw.choice((guid, b"{another %s%n}", b"", guid[:-1]))
            name, kind = self.draw.choice(NAMES), self.draw.choice((0, 1, 1, 2, -7))
            guid, name, callbacks = (self._or_null(each) for each in (guid, name, callbacks))
        resources = self.target.resources.encode()
        flags = self.draw.randrange(3), self.draw.randrange(3)
        pointer = byref(callbacks) if callbacks else None
        found = self.call("fmi2Instantiate", name, kind, guid, resources, pointer, *flags)
        if found and len(self.instances) > 2:
            self.dll.fmi2FreeInstance(c_void_p(found))
        elif found:
            self.instances.append(c_void_p(found))

    def free(self) -> None:
        gone = self.instances.pop()
        for owner, state in self.states:
            if owner is gone:
                self.call("fmi2FreeFMUstate", gone, byref(state))
        self.states = [s for s in self.states if s[0] is not gone]
        self.dll.fmi2FreeInstance(gone)

    def mode(self) -> None:
        name = ("EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset")
        self.call(f"fmi2{self.draw.choice(name)}", self._instance())

    def initialize(self) -> None:
        """In order, but for what is left out."""
        c, self.time = self._instance(), 0.0
        if self._rarely(0.7):
            self.call("fmi2Reset", c)
        if self._rarely(0.5):
            self.set_real(c)
        if not self._rarely():
            stop = self._time(1.0)
            self.call("fmi2SetupExperiment", c, 0, c_double(0), self._time(0.0), 1, stop)
        for name in ("fmi2EnterInitializationMode", "fmi2ExitInitializationMode"):
            if not self._rarely():
                self.call(name, c)

    def step(self) -> None:
        size = self._time(1 / 512)
        done = self.call("fmi2DoStep", self._instance(), self._time(self.time), size, 1)
        self.time += size.value if done == 0 else 0.0

    def get_real(self) -> None:
        references = self._references()
        values = self._array(c_double, [math.nan] * len(references))
        arguments = self._array(c_uint, references), c_size_t(len(references)), values
        self.call("fmi2GetReal", self._instance(), *arguments)

    def set_real(self, c: c_void_p | None = None) -> None:
        references = self._references()
        values = self._array(c_double, [self._real() for _ in references])
        arguments = self._array(c_uint, references), c_size_t(len(references)), values
        self.call("fmi2SetReal", c or self._instance(), *arguments)

    def other_type(self) -> None:
        kind, verb = self.draw.choice([*TYPES]), self.draw.choice(("Get", "Set"))
        references = self._references()
        values = self._array(TYPES[kind], [b"1" if kind == "String" else 1 for _ in references])
        arguments = self._array(c_uint, references), c_size_t(len(references)), values
        self.call(f"fmi2{verb}{kind}", self._instance(), *arguments)

    def status(self) -> None:
        kind = self.draw.choice(("Real", "Boolean", "Integer", "String", ""))
        value = self._or_null((c_double * 1)())
        self.call(f"fmi2Get{kind}Status", self._instance(), self.draw.randrange(-1, 6), value)
        self.call("fmi2CancelStep", self._instance())
        categories = self._array(c_char_p, [b"logAll", b"none"])
        self.call("fmi2SetDebugLogging", self._instance(), 1, c_size_t(2), categories)

    def derivatives(self) -> None:
        references = self._references()
        count = c_size_t(len(references))
        them = self._array(c_uint, references)
        values = self._array(c_double, [1.0 for _ in references])
        orders = self._array(c_int, [1 for _ in references])
        for name in ("fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives"):
            self.call(name, self._instance(), them, count, orders, values)
        rest = them, count, them, count, values, values
        self.call("fmi2GetDirectionalDerivative", self._instance(), *rest)

    # --- states ---------------------------------------------------------------------------

    def state(self) -> None:
        """Saved, into a new state or an old one, or restored."""
        c = self.draw.choice(self.instances)
        own = [state for owner, state in self.states if owner is c]
        if own and self._rarely(0.6):
            self.call("fmi2SetFMUstate", c, self._or_null(self.draw.choice(own)))
            return
        into = self.draw.choice(own) if own and (len(own) > 3 or self._rarely(0.5)) else c_void_p()
        self.call("fmi2GetFMUstate", c, self._or_null(byref(into)))
        if into and not any(into is state for state in own):
            self.states.append((c, into))

    def free_state(self) -> None:
        if self.states:
            c, state = self.states.pop(self.draw.randrange(len(self.states)))
            self.call("fmi2FreeFMUstate", c, byref(state))

    def bytes_of_a_state(self) -> None:
        """Serialised, perhaps damaged, and read back."""
        if not self.states:
            return
        (c, state), size = self.draw.choice(self.states), c_size_t()
        self.call("fmi2SerializedFMUstateSize", c, self._or_null(state), byref(size))
        if not size.value:
            return
        room = size.value - self.draw.randrange(9) * self._rarely(0.2)
        content = (ctypes.c_char * room)()
        if self.call("fmi2SerializeFMUstate", c, state, self._or_null(content), c_size_t(room)):
            return
        for _ in range(self.draw.randrange(4)):
            content[self.draw.randrange(room)] = self.draw.randrange(256)
        into = c_void_p()
        arguments = self._or_null(content), c_size_t(room), self._or_null(byref(into))
        self.call("fmi2DeSerializeFMUstate", c, *arguments)
        if into:
            self.states.append((c, into))


def main() -> None:
    target = Target(**json.loads(sys.argv[1]))
    with Path(target.told).open("r+b") as file, mmap.mmap(file.fileno(), TOLD) as told:
        Caller(target, told).run()
        told[:] = b"the end of the process".ljust(TOLD)


if __name__ == "__main__":
    main()
