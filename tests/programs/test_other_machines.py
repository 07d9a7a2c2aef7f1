"""The one FMU of a scene on other machines: the same life of two instances (life.c) as here, by its
binary for Windows under wine, and by its C files for ARM under qemu."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import zipfile
from functools import cache
from pathlib import Path

import pytest

from hapticlink.fmus.native.compiler import compile_library
from hapticlink.programs.build import OPTIONS
from tests.programs import windows
from tests.programs.built import COMPILER, needs_compiler, program
from tests.programs.windows import WINE

pytestmark = needs_compiler
ARM, QEMU = shutil.which("aarch64-linux-gnu-gcc"), shutil.which("qemu-aarch64")
FLAGS = ("-std=gnu11", "-O0", "-w", "-ffp-contract=off", *OPTIONS)


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the FMU's C files, with life.c beside it."""
    folder = tmp_path_factory.mktemp("one")
    with zipfile.ZipFile(program("closed-loop")) as archive:
        archive.extractall(folder)
    shutil.copy(Path(__file__).with_name("life.c"), folder)
    return folder / "sources"


def lived(command: list[str], sources: Path, **environment: str) -> float:
    """The sum of all variables after the life, as life.c prints it."""
    xml = (sources.parent / "modelDescription.xml").read_text()
    guid = re.search(r'guid="(.*?)"', xml)
    assert guid
    arguments = [guid[1], str(xml.count("<ScalarVariable")), repr(1 / 512)]
    done = subprocess.run(
        [*command, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=sources.parent,
        env={**os.environ, **environment},
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return float(done.stdout.rpartition(" ")[2])


@cache
def here(sources: Path) -> float:
    """The sum on this machine."""
    assert COMPILER
    compiled([COMPILER], sources, "life")
    return lived(["./life"], sources)


def compiled(compiler: list[str], sources: Path, name: str) -> None:
    files = [*map(str, sources.glob("*.c")), "life.c", "-lm"]
    command = [*compiler, *FLAGS, f"-I{sources}", "-o", name, *files]
    subprocess.run(command, cwd=sources.parent, check=True)


@pytest.mark.skipif(not (ARM and QEMU), reason="no cross compiler for ARM, or no qemu-aarch64")
def test_arm(sources: Path) -> None:
    compiled([str(ARM), "-static"], sources, "life-arm")
    assert lived([str(QEMU), "./life-arm"], sources) == pytest.approx(here(sources), rel=1e-13)


@pytest.mark.skipif(not WINE, reason="no wine64")
def test_windows(sources: Path) -> None:
    folder = sources.parent
    library = folder / "library.dll"  # the name that zig gives it inside, which life.exe asks for
    compile_library([*sources.glob("*.c")], library, "win64", OPTIONS)
    life = windows.program(folder / "life.c", library, [f"-I{sources}"])
    assert lived(life, sources, **windows.environment()) == pytest.approx(here(sources), rel=1e-13)
