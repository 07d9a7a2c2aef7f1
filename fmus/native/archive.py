"""The files of a native FMU, as bytes by name."""

from __future__ import annotations

import json
import tempfile
import uuid
from collections.abc import Sequence
from pathlib import Path

from hapticlink.components.component import Component
from hapticlink.fmus.archive import check_functions, digest, icon
from hapticlink.fmus.documentation import documentation
from hapticlink.fmus.model_description import model_description
from hapticlink.fmus.native.compiler import (
    FLAGS,
    SUFFIX,
    TARGETS,
    compile_library,
    compiler_version,
)
from hapticlink.fmus.native.source import component_source

WRAPPER = Path(__file__).parent / "fmi2.c"


def entries(
    component: Component,
    folder: Path,
    *,
    stop_time: float,
    step_size: float,
    platforms: Sequence[str],
) -> dict[str, bytes]:
    """All files of the FMU, with a binary for each of `platforms`, compiled in `folder`.

    The GUID is a hash of the binaries' sources, so that a platform's binary does not depend on the
    other platforms. Raises FmuError if no FMU can be built from the component, CompilerError if the
    source does not compile.
    """
    check_functions(component)

    def describe(guid: str) -> bytes:
        return model_description(
            component, guid, stop_time=stop_time, step_size=step_size, needs_tool=False
        )

    files = {
        "documentation/index.html": documentation(component),
        "model.png": icon(component.timing),
    }
    header, pieces = component_source(component)
    made_by = [compiler_version(), *FLAGS, TARGETS]
    content = {
        **files,
        "component.h": header.encode(),
        **{f"piece{k}.c": piece.encode() for k, piece in enumerate(pieces)},
        "fmi2.c": WRAPPER.read_bytes(),
        "compiler": json.dumps(made_by).encode(),
        "xml": describe(""),
    }
    guid = f"{{{uuid.UUID(digest(content)[:32])}}}"
    files["modelDescription.xml"] = describe(guid)
    with tempfile.TemporaryDirectory(dir=folder) as name:
        room = Path(name)
        head = f'#define GUID "{guid}"\n'.encode()
        (room / "component.h").write_bytes(head + content["component.h"])
        sources = [room / name for name in content if name.endswith(".c")]
        for source in sources:
            source.write_bytes(content[source.name])
        for platform in platforms:
            library = compile_library(sources, room / "library", platform)
            entry = f"binaries/{platform}/{component.name}{SUFFIX[platform]}"
            files[entry] = library.read_bytes()
    return files
