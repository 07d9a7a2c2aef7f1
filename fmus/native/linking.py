"""Links shared libraries with the C functions that a system itself has.

zig's own library, of what a system may lack, has to be built first: 8 s of processor time for each
target, and 50 s for Windows. Needs the standard library only, since the build of the package runs
it, too.
"""

from __future__ import annotations

from pathlib import Path

WINDOWS = Path(__file__).with_name("windows.c")
_UNIVERSAL_C_RUNTIME = (
    "convert", "environment", "filesystem", "heap", "locale", "math", "private", "process",
    "runtime", "stdio", "string", "time", "utility",
)  # fmt: skip


def system_libraries(target: str) -> list[str]:
    """The linker's arguments for one of zig's targets: the libraries of its system, with an error
    where they lack a function. None for WebAssembly, whose system has no library."""
    if "wasm" in target:
        return []
    if "windows" in target:
        parts = (f"-lapi-ms-win-crt-{part}-l1-1-0" for part in _UNIVERSAL_C_RUNTIME)
        return ["-nostdlib", str(WINDOWS), *parts, "-lkernel32"]
    undefined = ["-Wl,-z,defs"] if "linux" in target else []
    return ["-nostdlib", "-lc", "-lm", *undefined]
