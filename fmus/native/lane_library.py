"""A library with the step of several instances of a native FMU at once, lanes.cpp: made of the
FMU's own sources for the vector instructions of this machine, and kept beside it in the cache."""

from __future__ import annotations

import ctypes
import hashlib
import logging
import re
import sys
import tempfile
import zipfile
from functools import lru_cache
from pathlib import Path
from typing import Any

from hapticlink.fmus import cache
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.native import compiler

LOG = logging.getLogger(__name__)

LANES = 8
SOURCE = Path(__file__).parent / "lanes.cpp"
NEEDED = ("component.h", "fmi2_model.h")
"""Files of an FMU's sources of which the library is made."""
LEVELS = {
    "x86_64_v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
    "x86_64_v3": {"avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"},
}
"""zig's name of each level of x86-64, the highest first, and what Linux calls its instructions."""
OPTIONS = ("-std=gnu++17", "-fno-exceptions", "-fno-rtti", "-w")
_CHOICE = re.compile(r"\((a\d+)\?(a\d+):0\)")


def step_of_lanes(fmu: Path, compiles: bool) -> Any:
    """The function `step_lanes` for a native FMU, or None: where it is neither there nor to be
    compiled, where nothing is cached, without a compiler, for an FMU whose functions vectors do not
    take (they are in pieces, or look up tables), or with the interface of FMI 3, and on Windows,
    where it was not tried."""
    if sys.platform == "win32":
        return None
    return _find(fmu, fmu.stat().st_mtime_ns, cache.folder(), compiles)


@lru_cache(64)
def _find(fmu: Path, changed_ns: int, root: Path | None, compiles: bool) -> Any:
    """The same, looked for once as long as the file does not change."""
    library = _library(fmu) if root and root in fmu.parents else None
    if library and compiles and not library.exists():
        with cache.exclusively(library, f"steps of several {fmu.stem}", lambda: None):
            if not library.exists():
                compile_steps(fmu, library)
    return load_steps(library) if library and library.exists() else None


def load_steps(library: Path) -> Any:
    """The function of a library."""
    step = ctypes.CDLL(str(library)).step_lanes
    pointer, number = ctypes.c_void_p, ctypes.c_double
    step.argtypes, step.restype = (pointer, ctypes.c_int64, number, number, pointer), None
    return step


def _library(fmu: Path) -> Path | None:
    """Where the library of an FMU is kept; None where it cannot be made."""
    with zipfile.ZipFile(fmu) as archive:
        names = {name.removeprefix("sources/") for name in archive.namelist()}
        if not {*NEEDED} <= names or any(re.match(r"fmi3|piece\d", name) for name in names):
            return None
        if b"casadi_interpn" in archive.read("sources/component.h"):
            return None
    made_of = SOURCE.read_bytes() + repr((LANES, OPTIONS, level())).encode()
    return fmu.with_name(f"lanes-{hashlib.sha256(made_of).hexdigest()[:16]}.so")


@lru_cache(1)
def level() -> str:
    """The instructions that this machine has beyond those of all its kind, "" where none are known
    to be there."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    flags = next((set(line.split()) for line in lines if line.startswith("flags")), set())
    return next((name for name, needed in LEVELS.items() if needed <= flags), "")


def compile_steps(fmu: Path, library: Path) -> bool:
    """Compile the library of an FMU to its place, where it is whole or not at all; whether it is
    there."""
    options = [*OPTIONS, f"-DLANES={LANES}", *([f"-mcpu={level()}"] if level() else [])]
    with tempfile.TemporaryDirectory() as name, zipfile.ZipFile(fmu) as archive:
        room = Path(name)
        for file in NEEDED:
            text = archive.read(f"sources/{file}").decode()
            text = _CHOICE.sub(r"chosen(\1, \2)", text)
            (room / file).write_text(text.replace("x<0 ? -1 : x>0 ? 1 : x", "sign_of(x)"))
        source = room / SOURCE.name
        source.write_bytes(SOURCE.read_bytes())
        try:
            with atomic_file(library) as unfinished:
                compiler.compile_library(source, unfinished, options=options)
        except (FmuError, OSError) as error:
            LOG.info("steps of %s are taken one by one: %s", fmu.stem, error)
            return False
    return True
