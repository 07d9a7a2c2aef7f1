"""Our virtual mechanism, run two ways: CasADi's virtual machine, as a Python FMU does, and the
same function as C in a loop in C, generated and compiled as for a native FMU."""

from __future__ import annotations

import ctypes
import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism
from hapticlink.components.component import Component
from hapticlink.components.specs.linkage import Linkage, Mechanism
from hapticlink.fmus.native import compile_library
from hapticlink.fmus.native.source import functions

Vector = np.ndarray
_DRIVER = """
FMI2_Export void run(long steps, double* x, double* y, const double* u, const double* p,
         const double* h, casadi_int* iw, double* w) {
  double t = 0;
  const double* arg[ARGUMENTS] = {0};
  double* res[RESULTS] = {0};
  for (long k = 0; k < steps; ++k) {
    t = k * *h;
    arg[0] = x; arg[1] = u; arg[2] = p; arg[3] = &t; arg[4] = h;
    res[0] = y;
    step(arg, res, iw, w, 0);
    double* z = x; x = y; y = z;
  }
}
"""


@dataclass(frozen=True)
class Ours:
    """One linkage under one integrator and stabilisation, at one step h (s)."""

    linkage: Linkage
    wrench: tuple[float, float, float]
    mechanism: Mechanism
    h: float

    @cached_property
    def component(self) -> Component:
        return virtual_mechanism(self.linkage, self.mechanism, step_s=self.h)

    @cached_property
    def p(self) -> np.ndarray:
        return np.array(self.component.start_parameters)

    @cached_property
    def u(self) -> np.ndarray:
        return np.array([*self.wrench, 0.0, 0.0, 0.0])

    @cached_property
    def start(self) -> np.ndarray:
        """(q, qd), assembled."""
        return np.array(self.component.initialize(self.u, self.p)).ravel()

    def outputs(self, x: np.ndarray) -> dict[str, np.ndarray]:
        flat = np.array(self.component.output(x, self.u, self.p, 0.0)).ravel()
        found, offset = {}, 0
        for v in self.component.outputs:
            found[v.name] = flat[offset : offset + v.size]
            offset += v.size
        return found

    def virtual_machine(self) -> Callable[[int], tuple[float, ...]]:
        """As a Python FMU: (steps) -> the place (m) of the operational point, and the time (s) that
        they took from the start on."""
        x, after = np.zeros_like(self.start), np.zeros_like(self.start)
        given = (x, self.u, self.p, np.zeros(1), np.array([self.h]))
        buffer, trigger = in_place(self.component.step, given, after)

        def advance(start: np.ndarray, steps: int, kept: Any = buffer) -> np.ndarray:
            x[:] = start
            for k in range(steps):
                given[3][0] = k * self.h
                trigger()
                x[:] = after
            return x

        return self._timed(advance)

    def native(self, folder: Path) -> Callable[[int], tuple[float, ...]]:
        """As a native FMU."""
        return self._timed(self.advance(folder))

    def _timed(self, advance: Callable[..., np.ndarray]) -> Callable[[int], tuple[float, ...]]:
        d = self.linkage.dimension

        def run(steps: int) -> tuple[float, ...]:
            x, began = self.start.copy(), time.perf_counter()
            x = advance(x, steps)
            seconds = time.perf_counter() - began
            tip = self.outputs(x)["x"][:d] if np.isfinite(x).all() else np.full(d, np.nan)
            return *tip.tolist(), seconds

        return run

    def advance(self, folder: Path) -> Callable[..., np.ndarray]:
        """(state, steps, h) -> state, compiled; overwrites the state given."""
        return compiled(self.component.step, self.u, self.p, self.h, folder)


def compiled(
    step: ca.Function, u: Vector, p: Vector, h: float, folder: Path
) -> Callable[..., np.ndarray]:
    """(state, steps, h) -> state: a loop in C over `step` (x, u, p, t, h); overwrites the state."""
    call = ctypes.CDLL(str(_compiled(step, folder))).run
    double = ctypes.POINTER(ctypes.c_double)
    iw, w = np.zeros(step.sz_iw() + 1, dtype=np.int64), np.zeros(step.sz_w() + 1)
    y = np.zeros(step.size1_in(0))

    def run(x: np.ndarray, steps: int, h: float = h) -> np.ndarray:
        size = np.array([h])
        pointers = [a.ctypes.data_as(double) for a in (x, y, u, p, size)]
        work = iw.ctypes.data_as(ctypes.c_void_p), w.ctypes.data_as(double)
        call(ctypes.c_long(steps), *pointers, *work)
        return (y if steps % 2 else x).copy()

    return run


def in_place(
    step: ca.Function, arguments: Sequence[Vector], after: Vector
) -> tuple[Any, Callable[[], None]]:
    """A call that carries out a `step` on what the `arguments` (x, u, p, t, h) hold then, and
    writes the state `after` it, without allocating memory. The arrays and the buffer, which is
    returned first, have to be kept as long as it is called."""
    buffer: Any
    buffer, trigger = step.buffer()
    for i, values in enumerate(arguments):
        buffer.set_arg(i, values.data)
    buffer.set_res(0, after.data)
    return buffer, trigger


def _compiled(step: ca.Function, folder: Path) -> Path:
    """A shared library with `run`, kept under the hash of its source."""
    folder.mkdir(parents=True, exist_ok=True)
    sizes = f"#define ARGUMENTS {step.sz_arg()}\n#define RESULTS {step.sz_res()}\n"
    main, pieces = functions([step])
    texts = [sizes + '#include "fmi2Functions.h"\n' + main + _DRIVER, *pieces]
    library = folder / f"{hashlib.sha256(''.join(texts).encode()).hexdigest()[:16]}.so"
    if not library.exists():
        files = [library.with_suffix(f".{k}.c") for k in range(len(texts))]
        for file, text in zip(files, texts, strict=True):
            file.write_text(text)
        compile_library(files, library.with_suffix(".part")).rename(library)
        for file in files:
            file.unlink()
    return library
