"""Builds the FMU of a component as a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hapticlink.components.component import Component
from hapticlink.fmus.python_fmu_entries import entries, require_platform
from hapticlink.fmus.write_fmu import write_fmu


def build(component: Component, folder: Path | str, **experiment: float) -> Path:
    """Write the Python FMU `<folder>/<component.name>.fmu` and return its path.

    experiment: stop_time (1 s) and step_size (1/512 s) of the FMU's default experiment. The same
    component gives the same bytes. The file is written atomically, and only if FMPy's validation
    has no finding. Raises FmuError with the findings, and UnsupportedPlatform where pythonfmu has
    no binary.
    """
    require_platform()
    return write_fmu(entries(component, **experiment), folder, component.name)


def build_engine(
    component: Component, settings: Mapping[str, Any], folder: Path | str, **experiment: float
) -> Path:
    """As `build`, with the component's ports by a physics engine (`engine.mujoco_fmu`); `settings`
    are those of its block."""
    from hapticlink.fmus.engine import mujoco_fmu

    require_platform()
    files = mujoco_fmu.entries(component, settings, **experiment)
    return write_fmu(files, folder, component.name)


def build_native(
    component: Component,
    folder: Path | str,
    *,
    platforms: Sequence[str] = (),
    fmi: int = 2,
    **experiment: float,
) -> Path:
    """As `build`, with the component compiled for each of `platforms` (as the version `fmi` of the
    standard calls them: `hapticlink.fmus.native.compiler.TARGETS`), by default for this machine.
    The FMU needs no Python.

    Raises FmuError if ziglang is not installed or a platform is unknown, CompilerError if the
    source does not compile.
    """
    from hapticlink.fmus.native import host_platform, native_fmu_entries

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    platforms = tuple(platforms) or (host_platform(fmi),)
    files = native_fmu_entries.entries(component, folder, platforms, fmi, **experiment)
    return write_fmu(files, folder, component.name)
