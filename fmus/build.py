"""Builds the FMU of a component as a file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fmpy import read_model_description
from fmpy.model_description import ValidationError
from fmpy.validation import validate_fmu

from hapticlink.components.component import Component
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.python_fmu import entries, require_platform
from hapticlink.fmus.reproducible_zip import write


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
    return _publish(component, entries(component, stop_time=stop_time, step_size=step_size), folder)


def build_engine(
    component: Component,
    settings: Mapping[str, Any],
    folder: Path | str,
    *,
    stop_time: float = 1.0,
    step_size: float = 1 / 512,
) -> Path:
    """As `build`, with the component's ports by a physics engine (`engine.mujoco_fmu`); `settings`
    are those of its block."""
    from hapticlink.fmus.engine import mujoco_fmu

    require_platform()
    files = mujoco_fmu.entries(component, settings, stop_time=stop_time, step_size=step_size)
    return _publish(component, files, folder)


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
    from hapticlink.fmus.native import host_platform, native_fmu

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = native_fmu.entries(
        component,
        folder,
        stop_time=stop_time,
        step_size=step_size,
        platforms=tuple(platforms) or (host_platform(),),
    )
    return _publish(component, files, folder)


def _publish(component: Component, files: Mapping[str, bytes], folder: Path | str) -> Path:
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{component.name}.fmu"
    with atomic_file(target) as unfinished:
        with unfinished.open("xb") as file:
            write(files, file)
        findings = _findings(component, str(unfinished))
        if findings:
            raise FmuError(f"`{component.name}` fails validation:\n  " + "\n  ".join(findings))
    return target


_PLAIN = re.compile(
    r"(?!der\()[A-Za-z_]\w*(\[\d+(,\d+)*\])?(\.[A-Za-z_]\w*(\[\d+(,\d+)*\])?)*", re.A
)
"""Names that the grammar of FMI 2.0.5 section 2.2.9 allows, without quotes or derivatives."""


def _findings(component: Component, path: str) -> list[str]:
    """The findings of FMPy's validation. Its parser of names takes 1 ms for each (N = 40: 2 s of
    11), and is left out if all names are plain."""
    variables = (*component.inputs, *component.parameters, *component.outputs)
    if not all(_PLAIN.fullmatch(name) for v in variables for name in v.names):
        return validate_fmu(path)
    try:
        read_model_description(path, validate=True, validate_model_structure=True)
    except ValidationError as error:
        return list(error.problems)
    return []
