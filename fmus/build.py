"""Builds the FMU of a component as a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fmpy.validation import validate_fmu

from hapticlink.components.component import Component
from hapticlink.fmus.archive import entries, require_platform, write
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.errors import FmuError


def build(
    component: Component,
    folder: Path | str,
    *,
    stop_time: float = 1.0,
    step_size: float = 1 / 512,
) -> Path:
    """Write the Python FMU `<folder>/<component.name>.fmu` and return its path.

    stop_time and step_size (s) are the FMU's default experiment. The same component gives the same
    bytes. The file is written atomically, and only if FMPy's validation has no finding. Raises
    FmuError with the findings, and UnsupportedPlatform where pythonfmu has no binary.
    """
    require_platform()
    return _publish(
        component.name, entries(component, stop_time=stop_time, step_size=step_size), folder
    )


def build_native(
    component: Component,
    folder: Path | str,
    *,
    platforms: Sequence[str] = (),
    stop_time: float = 1.0,
    step_size: float = 1 / 512,
) -> Path:
    """As `build`, with the component compiled for each of `platforms` (names of
    `hapticlink.fmus.native.PLATFORMS`), by default for this machine. The FMU needs no Python.

    Raises FmuError if ziglang is not installed or a platform is unknown, CompilerError if the
    source does not compile.
    """
    from hapticlink.fmus.native import archive, host_platform

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    made = archive.entries(
        component,
        folder,
        stop_time=stop_time,
        step_size=step_size,
        platforms=tuple(platforms) or (host_platform(),),
    )
    return _publish(component.name, made, folder)


def _publish(name: str, files: Mapping[str, bytes], folder: Path | str) -> Path:
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{name}.fmu"
    with atomic_file(target) as unfinished:
        with unfinished.open("xb") as file:
            write(files, file)
        findings = validate_fmu(str(unfinished))
        if findings:
            raise FmuError(f"`{name}` fails validation:\n  " + "\n  ".join(findings))
    return target
