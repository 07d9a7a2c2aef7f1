"""Compiles C to a shared library, for this machine or another one, with the package `ziglang`.

The same source, platform and version of ziglang give the same bytes on every machine.

zig keeps the C library that it builds for each target, which linking needs, in a cache. A second
zig that starts within a tenth of a second of a first one with the same cache waits for a lock until
the first one has compiled, and two that find no library build it both. So each target has a cache,
which one zig uses at a time to link; compiling needs no cache.
"""

from __future__ import annotations

import os
import platform as machine
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import fmpy

from hapticlink.fmus import cache, lock
from hapticlink.fmus.errors import CompilerError, FmuError
from hapticlink.fmus.native.linking import system_libraries
from hapticlink.fmus.versions import install_command, version

_ARM_LINUX = sys.platform == "linux" and machine.machine().lower() in ("aarch64", "arm64")
TARGETS: dict[str, tuple[str, ...]] = {
    # A version old enough for the systems in use.
    "x86_64-linux": ("x86_64-linux-gnu.2.17",),
    "aarch64-linux": ("aarch64-linux-gnu.2.17",),
    "x86_64-windows": ("x86_64-windows-gnu",),
    "x86_64-darwin": ("x86_64-macos.11.0",),
    "aarch64-darwin": ("aarch64-macos.11.0",),
}
"""The compiler's targets for each platform of FMI 3.0 (section 2.5.1.4), and of FMI 2.0 (section
2.3): linux64 is x86-64, or ARM64 on an ARM machine with Linux, where importers use the same folder;
darwin64 contains both."""
PLATFORMS_3 = tuple(TARGETS)
TARGETS |= {
    "linux64": TARGETS["aarch64-linux" if _ARM_LINUX else "x86_64-linux"],
    "win64": TARGETS["x86_64-windows"],
    "darwin64": TARGETS["x86_64-darwin"] + TARGETS["aarch64-darwin"],
}
PLATFORMS = ("linux64", "win64", "darwin64")
# No contraction: a fused multiply-add rounds once where CasADi's virtual machine rounds twice. No
# vectorisation: its time grows with the square of the length of straight-line code, and it did not
# make the code faster.
_ARITHMETIC = ("-ffp-contract=off", "-fno-slp-vectorize")
FLAGS = ("-fPIC", "-std=gnu11", "-O2", *_ARITHMETIC, "-g0", "-fvisibility=hidden")
LINK = ("-shared", "-s")
WEBASSEMBLY = "wasm32-wasi"
WEBASSEMBLY_FLAGS = ("-std=gnu11", "-Os", *_ARITHMETIC, "-g0", "-fvisibility=hidden")
_ZIG = (sys.executable, "-m", "ziglang")
ZIG_CACHE = "ZIG_GLOBAL_CACHE_DIR"
"""zig's own environment variable: a folder that the user has chosen is used as it is."""
HEADERS = Path(fmpy.__file__).parent / "c-code"
FMI2_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")


def host_platform(fmi: int = 2) -> str:
    """The platform, as FMI 2.0 or 3.0 calls it, that this process can load. Raises FmuError if
    native FMUs cannot be built for it."""
    mine, known = (fmpy.platform, PLATFORMS) if fmi == 2 else (fmpy.platform_tuple, PLATFORMS_3)
    if mine not in known:
        raise FmuError(f"native FMUs are made for {', '.join(known)}; this is {mine}")
    return mine


def entry(platform: str, name: str) -> str:
    """The path in an FMU of its library `name` for a platform."""
    suffix = ".so" if "linux" in platform else ".dylib" if "darwin" in platform else ".dll"
    return f"binaries/{platform}/{name}{suffix}"


def compiler_version() -> str:
    """The version of ziglang. Raises FmuError if it is not installed."""
    try:
        return version("ziglang")
    except PackageNotFoundError:
        raise FmuError(
            "native FMUs are compiled with ziglang, which is not installed: "
            f'{install_command("native")}, or set packaging = "python"'
        ) from None


def compile_library(
    source: Path | str | Iterable[Path],
    library: Path | str,
    platform: str | None = None,
    options: Sequence[str] = (),
) -> Path:
    """Compile the C file `source` to the shared library `library` and return its path; several
    files are compiled side by side, each from when it comes.

    platform: one of PLATFORMS, by default this machine's. The FMI headers are on the include path,
    and only functions declared FMI2_Export are exported. options: further arguments of the compiler
    (-DNAME=VALUE, -fvisibility=default). Raises FmuError for an unknown platform, CompilerError
    with the compiler's output if the source does not compile.
    """
    library, files = Path(library).resolve(), source
    if isinstance(files, (Path, str)):
        files = [Path(files)]
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        made = binaries(files, "", Path(folder), [platform or host_platform()], options)
        library.write_bytes(next(made)[1])
    return library


def binaries(
    source: Iterable[Path],
    name: str,
    folder: Path,
    platforms: Sequence[str],
    options: Sequence[str] = (),
) -> Iterator[tuple[str, bytes]]:
    """Entries of an FMU with the shared library `name` for each of the platforms, compiled side by
    side in `folder`. Raises as `compile_library`."""
    compiler_version()
    if unknown := [platform for platform in platforms if platform not in TARGETS]:
        raise FmuError(f"no platform {unknown[0]!r}; there are {', '.join(PLATFORMS)}")
    targets = [target for platform in platforms for target in TARGETS[platform]]
    files = source if len(targets) == 1 else [*source]
    with ThreadPoolExecutor(len(targets)) as pool:
        compiled = pool.map(lambda target: _compile(files, folder, target, options), targets)
        made = dict(zip(targets, compiled, strict=True))
    for platform in platforms:
        slices = [made[target] for target in TARGETS[platform]]
        yield entry(platform, name), universal(slices) if len(slices) > 1 else slices[0]


def compile_webassembly(source: Iterable[Path], folder: Path, options: Sequence[str] = ()) -> bytes:
    """A WebAssembly module of C files, which exports what has an `export_name`. It imports a few
    functions of WASI, for files, which it does not call. Raises as `compile_library`."""
    compiler_version()
    return _compile(source, folder, WEBASSEMBLY, options)


def _compile(source: Iterable[Path], folder: Path, target: str, options: Sequence[str]) -> bytes:
    own_folder = folder / target
    own_folder.mkdir()
    link = [*LINK, *(["-Wl,-Bsymbolic", "-lm"] if "linux" in target else [])]
    if target == WEBASSEMBLY:
        link = ["-mexec-model=reactor", "-s"]
    # A Mach-O file contains the path that it was written to, so this is the same everywhere.
    objects = ["-o", "library", *_objects(source, own_folder, target, options)]
    try:
        _zig([*link, *system_libraries(target), *options, *objects], own_folder, target)
    except CompilerError:  # of functions that zig's own library may have
        _zig([*link, *options, *objects], own_folder, target)
    return (own_folder / "library").read_bytes()


def _objects(
    source: Iterable[Path], folder: Path, target: str, options: Sequence[str]
) -> list[str]:
    """Compiles C files side by side, and returns the names of the object files in `folder`."""
    jobs = {}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for file in source:
            command = [*options, "-c", "-o", f"{file.stem}.o", str(file.resolve())]
            jobs[f"{file.stem}.o"] = pool.submit(_zig, command, folder, target)
    for job in jobs.values():
        job.result()
    return [*jobs]


def global_names(source: Iterable[Path], folder: Path) -> list[str]:
    """The names that C files define for the linker, compiled in `folder` for Linux on x86-64. They
    are in the index of an archive of the object files, the entry "/": their count, as many
    big-endian offsets, and the names, each ended by a zero; names need no optimisation. Raises as
    `compile_library`."""
    compiler_version()
    objects = _objects(source, folder, TARGETS["x86_64-linux"][0], ("-O0", "-fno-sanitize=all"))
    archive = folder / "names.a"
    command = [*_ZIG, "ar", "--format=gnu", "rcs", archive.name, *objects]
    subprocess.run(command, cwd=folder, capture_output=True, check=True)
    content = archive.read_bytes()
    first, index = content[8:68], content[68:]  # behind "!<arch>\n"
    if first[:16].strip() != b"/":
        return []
    count, size = struct.unpack_from(">I", index)[0], int(first[48:58])
    names = index[4 + 4 * count : size].split(b"\0")[:count]
    return sorted({name.decode() for name in names})


def _zig(arguments: Iterable[str], folder: Path, target: str) -> None:
    flags = WEBASSEMBLY_FLAGS if target == WEBASSEMBLY else FLAGS
    command = [*_ZIG, "cc", "-target", target, *flags, f"-I{HEADERS}", *arguments]
    with tempfile.TemporaryDirectory(dir=folder) as local:
        # zig keeps its own C library in its cache, but not our code.
        compiles = nullcontext({ZIG_CACHE: local}) if "-c" in command else linker_cache(target)
        with compiles as chosen:
            environment = {**os.environ, **chosen, "ZIG_LOCAL_CACHE_DIR": local}
            done = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True, check=False
            )
    if done.returncode:
        name = Path(command[-1]).name
        raise CompilerError(f"{name} does not compile for {target}:\n{done.stderr.strip()}")


@contextmanager
def linker_cache(target: str) -> Iterator[dict[str, str]]:
    """The environment variables to link for a target: of a cache in the user's folder, else in that
    of built FMUs, else of one for this once; none where the user has chosen zig's own."""
    if ZIG_CACHE in os.environ:
        yield {}
        return
    with ExitStack() as stack:
        for folder in (cache.user_folder(), cache.folder()):
            if folder and cache.is_own(folder) and _is_writable(root := folder / "zig"):
                with suppress(OSError):
                    held = lock.hold_lock(root / f"{target}.lock", lambda: None)
                    stack.enter_context(held)
                    yield {ZIG_CACHE: str(root / target)}
                    return
        yield {ZIG_CACHE: stack.enter_context(tempfile.TemporaryDirectory())}


def _is_writable(folder: Path) -> bool:
    try:
        cache.private(folder.parent)
        cache.private(folder)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


_CPU = {0x01000007: 3, 0x0100000C: 0}  # x86-64 and ARM64, with the subtype "all" of each
_PAGE = 14  # log2 of the larger page size of the two


def universal(slices: Iterable[bytes]) -> bytes:
    """A Mach-O file with a library for several processors (<mach-o/fat.h>): the big-endian header
    0xCAFEBABE, the count, and (cputype, subtype, offset, size, alignment) of each slice."""
    slices = list(slices)
    head = struct.pack(">II", 0xCAFEBABE, len(slices))
    body, offset = b"", 1 << _PAGE
    for part in slices:
        cpu = struct.unpack_from("<I", part, 4)[0]
        head += struct.pack(">IIIII", cpu, _CPU[cpu], offset + len(body), len(part), _PAGE)
        body += part + bytes(-len(part) % (1 << _PAGE))
    return head.ljust(offset, b"\0") + body
