"""The files of a native FMU, as bytes by name."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path

from hapticlink.components.component import Component
from hapticlink.fmus import model_description
from hapticlink.fmus.description_common import describe_component
from hapticlink.fmus.documentation import PAGE, documentation
from hapticlink.fmus.fmu_functions import GRAPHS
from hapticlink.fmus.native.compiler import (
    FLAGS,
    FMI2_HEADERS,
    HEADERS,
    TARGETS,
    binaries,
    compiler_version,
)
from hapticlink.fmus.native.fmi3_interface import fmi3_sources
from hapticlink.fmus.native.linking import WINDOWS
from hapticlink.fmus.native.source import component_source
from hapticlink.fmus.python_fmu_entries import check_functions
from hapticlink.fmus.reference_run import reference_run
from hapticlink.fmus.reproducible_zip import digest, guid_of

WRAPPER = Path(__file__).parent / "fmi2.c"
INCLUDED = tuple(Path(__file__).parent / name for name in ("fmi2_common.h", "fmi2_model.h"))
"""What it includes."""


def entries(
    component: Component,
    folder: Path,
    platforms: Sequence[str],
    fmi: int = 2,
    **experiment: float,
) -> dict[str, bytes]:
    """All files of the FMU, with a binary for each of `platforms`, compiled in `folder`, and in
    sources/ the C files from which `cc *.c` makes one for any other. experiment: as of
    `describe_component`.

    The GUID is a hash of the binaries' sources (component.h has that of pieces), so that a
    platform's binary does not depend on the other platforms. Raises FmuError if no FMU can be built
    from the component, CompilerError if the source does not compile.
    """
    with GRAPHS:
        check_functions(component)
        header, pieces = component_source(component)
        about = describe_component(component, False, **experiment)
        run = reference_run(component, about.step_size)
        files = {PAGE: documentation(component, run)}
    own = {path.name: path.read_bytes() for path in (WRAPPER, *INCLUDED)}
    if fmi == 3:
        own |= {name: text.encode() for name, text in fmi3_sources(about.variables).items()}
    made_by = [compiler_version(), *FLAGS, TARGETS]
    content = {
        **files,
        **own,
        "component.h": header.encode(),
        WINDOWS.name: WINDOWS.read_bytes(),
        "compiler": json.dumps(made_by).encode(),
        **model_description.files(about, "", fmi),
    }
    guid = guid_of(digest(content))
    own["component.h"] = f'#define GUID "{guid}"\n'.encode() + content["component.h"]
    with tempfile.TemporaryDirectory(dir=folder) as name:
        room = Path(name)
        for file, text in own.items():
            (room / file).write_bytes(text)
        interface = [room / file for file in own if file.endswith(".c")]
        sources = chain(interface, _write_pieces(pieces, room))
        files |= binaries(sources, component.name, room, platforms)
        own |= {path.name: path.read_bytes() for path in sorted(room.glob("piece*.c"))}
    own |= {file: (HEADERS / file).read_bytes() for file in FMI2_HEADERS}
    listed = [file for file in own if file.endswith(".c")]
    files |= {f"sources/{file}": text for file, text in own.items()}
    return files | model_description.files(about, guid, fmi, listed)


def _write_pieces(pieces: Iterable[str], folder: Path) -> Iterator[Path]:
    for k, piece in enumerate(pieces):
        path = folder / f"piece{k:03}.c"
        path.write_text(piece)
        yield path
