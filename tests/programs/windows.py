"""Programs for Windows, under wine."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from hapticlink.fmus.native.linking import system_libraries

WINE = shutil.which("wine64") or shutil.which("wine64", path="/usr/lib/wine")
TARGET = "x86_64-windows-gnu"
ENTRY = "-Wl,--entry,mainCRTStartup"
START = Path(__file__).with_name("windows_start.c")


def program(source: Path, library: Path, options: Sequence[str] = ()) -> list[str]:
    """The command that runs the C file `source` with a DLL beside it."""
    folder, zig = source.parent, [sys.executable, "-m", "ziglang", "cc", "-target", TARGET, "-O1"]
    for file in (source, START):
        command = [*zig, *options, "-c", "-o", f"{file.stem}.o", str(file)]
        subprocess.run(command, cwd=folder, check=True)
    objects = [f"{source.stem}.o", f"{START.stem}.o", library.name]
    command = [*zig, ENTRY, *system_libraries(TARGET), "-o", f"{source.stem}.exe", *objects]
    subprocess.run(command, cwd=folder, check=True)
    return [str(WINE), str(folder / f"{source.stem}.exe")]


@cache
def _prefix() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="wine-")


def environment() -> dict[str, str]:
    """That of wine, with its files in a temporary folder."""
    return {**os.environ, "WINEDEBUG": "-all", "WINEPREFIX": _prefix().name}
