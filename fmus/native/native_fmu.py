"""The files of a native FMU, as bytes by name."""

from __future__ import annotations

import json
import tempfile
import uuid
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path

from hapticlink.components.component import Component
from hapticlink.fmus.documentation import documentation
from hapticlink.fmus.fmu_functions import GRAPHS
from hapticlink.fmus.model_description import model_description, with_sources
from hapticlink.fmus.native.compiler import (
    FLAGS,
    FMI2_HEADERS,
    HEADERS,
    TARGETS,
    compile_library,
    compiler_version,
    entry,
)
from hapticlink.fmus.native.linking import WINDOWS
from hapticlink.fmus.native.source import component_source
from hapticlink.fmus.python_fmu import check_functions, icon
from hapticlink.fmus.reproducible_zip import digest

WRAPPER = Path(__file__).parent / "fmi2.c"
COMMON = Path(__file__).parent / "fmi2_common.h"
"""What it includes."""
FMI3 = Path(__file__).parent / "fmi3.c"
"""An interface of FMI 3.0 over that of FMI 2.0."""


def entries(
    component: Component,
    folder: Path,
    *,
    stop_time: float,
    step_size: float,
    platforms: Sequence[str],
) -> dict[str, bytes]:
    """All files of the FMU, with a binary for each of `platforms`, compiled in `folder`, and in
    sources/ the C files from which `cc *.c` makes one for any other.

    The GUID is a hash of the binaries' sources (component.h has that of pieces), so that a
    platform's binary does not depend on the other platforms. Raises FmuError if no FMU can be built
    from the component, CompilerError if the source does not compile.
    """
    with GRAPHS:
        check_functions(component)
        header, pieces = component_source(component)
        xml = model_description(
            component, "", stop_time=stop_time, step_size=step_size, needs_tool=False
        )
        files = {
            "documentation/index.html": documentation(component),
            "model.png": icon(component.timing),
        }
    made_by = [compiler_version(), *FLAGS, TARGETS]
    content = {
        **files,
        "component.h": header.encode(),
        "fmi2.c": WRAPPER.read_bytes(),
        COMMON.name: COMMON.read_bytes(),
        WINDOWS.name: WINDOWS.read_bytes(),
        "compiler": json.dumps(made_by).encode(),
        "xml": xml,
    }
    guid = f"{{{uuid.UUID(digest(content)[:32])}}}"
    xml = xml.replace(b'guid=""', f'guid="{guid}"'.encode(), 1)
    with tempfile.TemporaryDirectory(dir=folder) as name:
        room = Path(name)
        head = f'#define GUID "{guid}"\n'.encode()
        (room / "component.h").write_bytes(head + content["component.h"])
        main = room / "fmi2.c"
        main.write_bytes(content["fmi2.c"])
        (room / COMMON.name).write_bytes(content[COMMON.name])
        sources: Iterable[Path] = chain([main], _written(pieces, room))
        for platform in platforms:
            library = compile_library(sources if pieces else main, room / "library", platform)
            sources = [main, *sorted(room.glob("piece*.c"))]
            files[entry(platform, component.name)] = library.read_bytes()
        files["modelDescription.xml"] = with_sources(xml, (path.name for path in sources))
        for path in (*sources, room / "component.h", room / COMMON.name):
            files[f"sources/{path.name}"] = path.read_bytes()
    return files | {f"sources/{name}": (HEADERS / name).read_bytes() for name in FMI2_HEADERS}


def _written(pieces: Iterable[str], folder: Path) -> Iterator[Path]:
    for k, piece in enumerate(pieces):
        path = folder / f"piece{k:03}.c"
        path.write_text(piece)
        yield path
