"""The one FMU of a scene on other machines: the same life of two instances as here, by its binary
for Windows under wine, and by its C files for ARM under qemu."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pytest

from hapticlink.fmus.native.compiler import compile_library
from hapticlink.programs.build import OPTIONS
from tests.programs import life, windows
from tests.programs.built import COMPILER, needs_compiler, program
from tests.programs.windows import WINE

pytestmark = needs_compiler
ARM, QEMU = shutil.which("aarch64-linux-gnu-gcc"), shutil.which("qemu-aarch64")
FLAGS = ("-std=gnu11", "-O0", "-w", "-ffp-contract=off", *OPTIONS)


@dataclass
class Unpacked:
    """An FMU of a scene in a folder, with the life beside it as life.c."""

    folder: Path

    @property
    def sources(self) -> Path:
        return self.folder / "sources"

    @property
    def description(self) -> str:
        return (self.folder / "modelDescription.xml").read_text()

    def compiled(self, compiler: list[str], name: str) -> Path:
        """The life with the FMU's C files."""
        files = [*map(str, self.sources.glob("*.c")), "life.c", "-lm"]
        command = [*compiler, *FLAGS, f"-I{self.sources}", "-o", name, *files]
        subprocess.run(command, cwd=self.folder, check=True)
        return self.folder / name

    @cached_property
    def here(self) -> float:
        """The sum on this machine."""
        assert COMPILER
        return life.lived([self.compiled([COMPILER], "here")], self.description)


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI 2.0", "FMI 3.0"])
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Unpacked:
    folder = tmp_path_factory.mktemp("one")
    with zipfile.ZipFile(program("closed-loop", fmi=request.param)) as archive:
        archive.extractall(folder)
    shutil.copy(life.SOURCES[request.param], folder / "life.c")
    return Unpacked(folder)


@pytest.mark.skipif(not (ARM and QEMU), reason="no cross compiler for ARM, or no qemu-aarch64")
def test_arm(fmu: Unpacked) -> None:
    command = [str(QEMU), fmu.compiled([str(ARM), "-static"], "on-arm")]
    assert life.lived(command, fmu.description) == pytest.approx(fmu.here, rel=1e-13)


@pytest.mark.skipif(not WINE, reason="no wine64")
def test_windows(fmu: Unpacked) -> None:
    library = fmu.folder / "library.dll"  # its name inside, by which life.exe asks for it
    compile_library([*fmu.sources.glob("*.c")], library, "win64", OPTIONS)
    command = windows.program(fmu.folder / "life.c", library, [f"-I{fmu.sources}"])
    found = life.lived(command, fmu.description, windows.environment())
    assert found == pytest.approx(fmu.here, rel=1e-13)
