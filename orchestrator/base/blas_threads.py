"""Threads of BLAS, of which an analysis takes one.

Its matrices have a hundred rows: threads would wait for each other, several times as long as one
computes. NumPy and SciPy bring an OpenBLAS each, whose functions are found through the modules
that are linked with it; where there is another BLAS, nothing is changed.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Lock, get_ident
from typing import NamedTuple

LINKED = ("numpy.linalg._umath_linalg", "scipy.linalg._fblas")
"""Modules that call a BLAS, which is loaded with them."""
NAMES = (
    "scipy_openblas_{}_num_threads64_", "scipy_openblas_{}_num_threads",
    "openblas_{}_num_threads64_", "openblas_{}_num_threads",
)  # fmt: skip
"""By their wheels, and by distributions; {} is `get` or `set`."""


class Blas(NamedTuple):
    """The functions of a library that get and set its number of threads."""

    get: Callable[[], int]
    set: Callable[[int], object]


_lock = Lock()
_inside = Counter[int]()
"""The contexts that are open, by thread."""
_before: list[tuple[Blas, int]] = []
"""The libraries that are limited, each with its threads without the limit."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Within the context, BLAS computes in the thread that calls it, in all threads of the process;
    after the last of the contexts that are open at the same time it has as many as before the
    first. Also a decorator of functions."""
    thread = get_ident()
    with _lock:
        _inside[thread] += 1
        for library in loaded_blas():
            if (threads := library.get()) > 1:
                _before.append((library, threads))
                library.set(1)
    try:
        yield
    finally:
        with _lock:
            _inside[thread] -= 1
            _restore_behind_last()


def _restore_behind_last() -> None:
    """Forget threads without a context; where there is none left, restore the numbers."""
    for thread in [thread for thread, count in _inside.items() if not count]:
        del _inside[thread]
    while _before and not _inside:
        library, threads = _before.pop()
        library.set(threads)


def _go_on_in_child() -> None:
    """In a forked process there is the thread that forked alone, and its contexts."""
    for thread in _inside.keys() - {get_ident()}:
        del _inside[thread]
    _restore_behind_last()
    _lock.release()


if sys.platform != "win32":
    os.register_at_fork(
        before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_go_on_in_child
    )


def loaded_blas() -> Iterator[Blas]:
    """Each OpenBLAS that NumPy and SciPy have loaded so far."""
    for name in LINKED:
        if (module := sys.modules.get(name)) and (found := _find_blas(str(module.__file__))):
            yield found


@cache
def _find_blas(module: str) -> Blas | None:
    """The OpenBLAS of an extension module. Its handle finds the functions of the libraries that it
    is linked with, but for Windows, where wheels have these in a folder beside the package."""
    files = [Path(module)]
    if sys.platform == "win32":
        package = files[0].parents[1]
        files = [*package.with_name(f"{package.name}.libs").glob("*openblas*.dll")]
    for library in map(ctypes.CDLL, map(str, files)):
        for name in NAMES:
            if hasattr(library, name.format("set")):
                return Blas(library[name.format("get")], library[name.format("set")])
    return None
