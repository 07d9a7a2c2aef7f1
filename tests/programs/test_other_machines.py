"""The one FMU of a scene on other machines: the same life of two instances as here, by its binary
for Windows under wine, and by its C files for ARM under qemu."""

import os
import shutil
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pytest

from hapticlink.fmus.native.compiler import compile_library
from hapticlink.programs.build import OPTIONS
from tests.programs import life, windows
from tests.programs.built import COMPILER, FLAGS, needs_compiler, program, sources
from tests.programs.windows import WINE

pytestmark = needs_compiler
ARM, QEMU = shutil.which("aarch64-linux-gnu-gcc"), shutil.which("qemu-aarch64")


@dataclass
class Life:
    """The life of an FMU of a scene."""

    fmi: int
    folder: Path

    @cached_property
    def files(self) -> dict[str, bytes]:
        with zipfile.ZipFile(program("closed-loop-ideal", fmi=self.fmi)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}

    def lived(self, command: list[str], environment: Mapping[str, str] = os.environ) -> float:
        return life.lived(command, self.files["modelDescription.xml"].decode(), environment)

    @cached_property
    def here(self) -> float:
        """The sum on this machine."""
        return self.lived(
            [str(life.made(str(COMPILER), sources(self.files), self.fmi, self.folder))]
        )


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI 2.0", "FMI 3.0"])
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Life:
    return Life(request.param, tmp_path_factory.mktemp("one"))


@pytest.mark.skipif(not (ARM and QEMU), reason="no cross compiler for ARM, or no qemu-aarch64")
def test_arm(fmu: Life, tmp_path: Path) -> None:
    made = life.made(str(ARM), sources(fmu.files), fmu.fmi, tmp_path, ("-static", *FLAGS))
    assert fmu.lived([str(QEMU), str(made)]) == pytest.approx(fmu.here, rel=1e-13)


@pytest.mark.skipif(not WINE, reason="no wine64")
def test_windows(fmu: Life, tmp_path: Path) -> None:
    for name, content in sources(fmu.files).items():
        (tmp_path / name).write_bytes(content)
    files = sorted(tmp_path.glob("*.c"))
    library = tmp_path / "library.dll"  # its name inside, by which life.exe asks for it
    # Optimised as for users: -O0 calls functions that zig would build its whole library for.
    compile_library(files, library, "win64", OPTIONS)
    shutil.copy(life.SOURCES[fmu.fmi], tmp_path / "life.c")
    command = windows.program(tmp_path / "life.c", library, [f"-I{tmp_path}"])
    found = fmu.lived(command, windows.environment())
    assert found == pytest.approx(fmu.here, rel=1e-13)
