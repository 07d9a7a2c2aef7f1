"""Compiles the loop's C files to a shared library. It needs the standard library only, since the
build of the package runs it, too."""

from __future__ import annotations

import hashlib
import os
import platform
import runpy
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).absolute().parent
HOLD_TABLE: str = runpy.run_path(str(HERE.parents[1] / "holds" / "table.py"))["hold_table_h"]()
"""The header hold_table.h."""
LINKING = runpy.run_path(str(HERE.parents[2] / "fmus" / "native" / "linking.py"))
SOURCES = sorted(path.name for path in HERE.glob("*.[ch]"))
# No contraction: a fused multiply-add rounds once where Python rounds twice.
FLAGS = ("-fPIC", "-std=gnu11", "-O2", "-g0", "-fvisibility=hidden", "-ffp-contract=off")
WHEELS = {
    "manylinux_2_17_x86_64": "x86_64-linux-gnu.2.17",
    "manylinux_2_17_aarch64": "aarch64-linux-gnu.2.17",
    "macosx_11_0_x86_64": "x86_64-macos.11.0",
    "macosx_11_0_arm64": "aarch64-macos.11.0",
    "win_amd64": "x86_64-windows-gnu",
}
"""The compiler's target for each platform tag of a wheel (PEP 425, PEP 600): systems old enough for
those in use, and all of them from any machine."""
_ENDINGS = {"macosx": ".dylib", "win": ".dll"}


class Compiler(NamedTuple):
    """The command of a C compiler, and its arguments to link with the libraries of a system."""

    command: Sequence[str]
    libraries: Sequence[str] = ("-lm",)


def this_machine() -> str | None:
    """The platform tag of wheels for this machine, None where WHEELS has none."""
    processor = platform.machine().lower()
    processor = {"amd64": "x86_64", "aarch64": "arm64"}.get(processor, processor)
    if sys.platform == "linux" and platform.libc_ver()[0] != "glibc":
        return None
    tag = {
        "linux": f"manylinux_2_17_{processor.replace('arm64', 'aarch64')}",
        "darwin": f"macosx_11_0_{processor}",
        "win32": f"win_{processor.replace('x86_64', 'amd64')}",
    }.get(sys.platform)
    return tag if tag in WHEELS else None


def name(tag: str | None = None) -> str:
    """The library's file name, for this machine or the platform tag of a wheel, with a hash of its
    sources, so that an older one is never taken."""
    sha = hashlib.sha256()
    for source in SOURCES:
        sha.update((HERE / source).read_bytes().replace(b"\r\n", b"\n"))
    sha.update(HOLD_TABLE.encode())
    system = (tag or this_machine() or "").partition("_")[0]
    return f"loop-{sha.hexdigest()[:16]}{_ENDINGS.get(system, '.so')}"


def compilers() -> Iterator[Compiler]:
    """The compilers that are there: the machine's own, which takes a fraction of a second, then the
    package `ziglang`."""
    for command in ("cc", "gcc", "clang"):
        if sys.platform != "win32" and (path := shutil.which(command)):
            yield Compiler([path])
    if find_spec("ziglang"):
        yield zig()


def zig(tag: str | None = None) -> Compiler:
    """The package `ziglang`, for this machine or the platform tag of a wheel. Raises KeyError for a
    tag that WHEELS does not have."""
    command, tag = [sys.executable, "-m", "ziglang", "cc"], tag or this_machine()
    if tag is None:
        return Compiler(command)
    return Compiler([*command, "-target", WHEELS[tag]], LINKING["system_libraries"](WHEELS[tag]))


def compile_loop(library: Path, compiler: Compiler) -> None:
    """Compile the loop to `library`, which is there whole or not at all. Raises
    subprocess.CalledProcessError, or OSError, where that fails."""
    with tempfile.TemporaryDirectory(dir=library.parent, prefix=".loop-") as folder:
        room = Path(folder)
        environment = {**os.environ, "ZIG_LOCAL_CACHE_DIR": str(room / "cache")}

        def run(*arguments: str) -> None:
            command = [*compiler.command, *FLAGS, *arguments]
            subprocess.run(command, cwd=room, check=True, capture_output=True, env=environment)

        (room / "hold_table.h").write_text(HOLD_TABLE, encoding="utf-8")
        sources = [HERE / source for source in SOURCES if source.endswith(".c")]
        for source in sources:
            run("-I.", "-c", "-o", f"{source.stem}.o", str(source))
        objects = [f"{source.stem}.o" for source in sources]
        run("-shared", "-o", library.name, *objects, *compiler.libraries)
        os.replace(room / library.name, library)
