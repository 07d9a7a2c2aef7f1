from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterator
from importlib import metadata
from typing import Any

from hapticlink.commands.options import Json, print_result
from hapticlink.fmus.versions import install_command

HIDDEN = ("test",)
"""Extras for those who change the project, not for those who use it."""


def doctor(*, json: Json = False) -> int:
    """Report versions, optional packages that are missing and how to install them, and the cache;
    build a small FMU of each packaging that is available, and run it. The exit status is 1 if that
    fails."""
    environment = _collect()
    print_result(_lines(environment), environment, quiet=False, as_json=json)
    return 0 if all(state == "works" for state in environment["runs"].values()) else 1


def _collect() -> dict[str, Any]:
    from hapticlink.fmus import cache

    folder = cache.folder()
    fmus = [*folder.glob("**/*.fmu")] if folder else []
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "processors": os.cpu_count(),
        "versions": _versions(metadata.requires("hapticlink") or (), ""),
        "extras": {
            extra: _versions(metadata.requires("hapticlink") or (), extra)
            for extra in metadata.metadata("hapticlink").get_all("Provides-Extra") or ()
            if extra not in HIDDEN
        },
        "compiled_loop": _loop(),
        "cache": {
            "folder": str(folder) if folder else None,
            "fmus": len(fmus),
            "bytes": sum(f.stat().st_size for f in fmus),
        },
        "runs": _runs(),
    }


def _versions(requirements: Any, extra: str) -> dict[str, str | None]:
    """The packages that an extra, or with "" the project itself, asks for on this platform, with
    the versions that are there; None where one is missing or too old."""
    from packaging.requirements import Requirement

    versions: dict[str, str | None] = {}
    for text in requirements:
        asked = Requirement(text)
        needed = asked.marker is None or asked.marker.evaluate({"extra": extra})
        if not needed or (extra and (asked.marker is None or asked.marker.evaluate({"extra": ""}))):
            continue
        if asked.name == "hapticlink":  # an extra that takes in others
            for inner in asked.extras:
                versions |= _versions(requirements, inner)
            continue
        try:
            version = metadata.version(asked.name)
        except metadata.PackageNotFoundError:
            versions[asked.name] = None
        else:
            versions[asked.name] = version if asked.specifier.contains(version, True) else None
    return versions


def _loop() -> str:
    from hapticlink.orchestrator.base.errors import Fault
    from hapticlink.orchestrator.run.compiled import library

    try:
        library.load()
    except Fault as why:
        return f"no: {why}"
    return "yes"


def _runs() -> dict[str, str]:
    """For each packaging of FMUs that can be built here, `works` or what went wrong."""
    from importlib.util import find_spec

    import hapticlink as hl
    from hapticlink.orchestrator.base import interrupt
    from hapticlink.orchestrator.base.errors import Fault

    states = {}
    for packaging in ("python", "native") if find_spec("ziglang") else ("python",):
        try:
            made = hl.run("pendulum", {"duration": 0.05, "packaging": packaging})
            states[packaging] = str(made.fault) if made.fault else "works"
        except Fault as fault:
            states[packaging] = str(fault)
        interrupt.raise_if_interrupted()  # Ctrl-C is no fault of the FMU
    return states


def _lines(environment: dict[str, Any]) -> Iterator[str]:
    versions = [
        f"{name} {version or 'MISSING'}" for name, version in environment["versions"].items()
    ]
    yield f"hapticlink {metadata.version('hapticlink')} in {sys.prefix}"
    yield (
        f"Python {environment['python']} on {environment['platform']}, "
        f"{environment['processors']} processors; "
        f"{', '.join(versions)}"
    )
    yield f"compiled event loop: {environment['compiled_loop']}"
    for packaging, state in environment["runs"].items():
        yield f"FMUs, packaging = {packaging!r}: {state}"
    if "native" not in environment["runs"]:
        yield f"FMUs, packaging = 'native': no compiler: {install_command('native')}"
    for extra, packages in environment["extras"].items():
        missing = [name for name, version in packages.items() if version is None]
        state = (
            f"missing {', '.join(missing)}: {install_command(extra)}" if missing else "installed"
        )
        yield f"extra {extra}: {state}"
    cache = environment["cache"]
    if cache["folder"] is None:
        yield "cache of FMUs: off (HAPTICLINK_CACHE)"
    else:
        size = f"{cache['fmus']} FMUs, {cache['bytes'] / 1e6:.0f} MB"
        yield f"cache of FMUs: {cache['folder']}, {size}"
