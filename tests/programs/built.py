"""Programs of scenes for tests: compiled by the machine's own compiler without optimisation, each C
file once, since another hold or rate changes the data of a scene alone."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache, partial
from hashlib import sha256
from pathlib import Path

import pytest
from fmpy import platform, platform_tuple, sharedLibraryExtension

from hapticlink.fmus.write_fmu import write_fmu
from hapticlink.orchestrator import open_scene
from hapticlink.programs.build import OPTIONS, program_files
from tests.shared_fixtures import made_once

DATA_OF = {"program.c": "scene.h", "fmi3.c": "fmi3_rest.h"}
"""The C files that depend on the scene, with the headers that hold its data."""
COMPILER = shutil.which("cc")
FLAGS = ("-std=gnu11", "-fPIC", "-O0", "-w", "-ffp-contract=off", "-fvisibility=hidden", *OPTIONS)
needs_compiler = pytest.mark.skipif(
    COMPILER is None or platform != "linux64", reason="no C compiler of the machine's own"
)


folder = Path()
"""Where they are kept, as `conftest.py` says."""


def program(
    scene: str, options: tuple[str, ...] = (), without: str | None = None, fmi: int = 2
) -> Path:
    """The FMU of a scene."""
    return _program(scene, options, without, fmi)


@cache
def _program(scene: str, options: tuple[str, ...], without: str | None, fmi: int) -> Path:
    files = program_files(open_scene.load(scene, options), "program", without, fmi)
    room = Path(tempfile.mkdtemp(dir=folder))
    shared = ("-shared", "-Wl,-Bsymbolic")
    library = linked(str(COMPILER), sources(files), room / "library", FLAGS, shared).read_bytes()
    place = platform if fmi == 2 else platform_tuple
    whole = {**files, f"binaries/{place}/program{sharedLibraryExtension}": library}
    return write_fmu(whole, room, "program")


def sources(files: Mapping[str, bytes]) -> dict[str, bytes]:
    """The files in the folder `sources` of an FMU."""
    return {n.removeprefix("sources/"): files[n] for n in files if n.startswith("sources/")}


def linked(
    compiler: str,
    sources: dict[str, bytes],
    target: Path,
    flags: Sequence[str] = FLAGS,
    link: Sequence[str] = (),
) -> Path:
    """What a compiler makes of C files. Raises CalledProcessError with what it said."""
    foreign = {n for n in sources if "/" in n}
    headers_alone = {n for n in sources if n.endswith(".h")} - {*DATA_OF.values()}
    shared = sorted(foreign | headers_alone)
    headers = b"".join(sources[n] for n in shared if not n.startswith("fmi3"))
    objects = []
    with tempfile.TemporaryDirectory(dir=folder) as name:
        room = Path(name)
        for file, content in sources.items():
            (room / file).parent.mkdir(parents=True, exist_ok=True)
            (room / file).write_bytes(content)
        for file in sorted(n for n in sources if n.endswith(".c") and n not in foreign):
            uses = sources[DATA_OF[file]] if file in DATA_OF else b""
            how = map(str.encode, (compiler, *flags))
            key = sha256(b"\0".join([sources[file], headers, uses, *how]))
            objects.append(
                made_once(
                    folder / f"{key.hexdigest()}.o",
                    partial(_run, compiler, *flags, "-c", room / file, "-o"),
                )
            )
        _run(compiler, *flags, *link, "-o", target, *objects, "-lm")
    return target


def _run(*command: str | Path) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True)
