"""A scene as a page in one file: the page that `view` serves, with the scene as WebAssembly."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

from hapticlink.fmus import cache, reproducible_zip
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.errors import CompilerError, FmuError
from hapticlink.fmus.native.compiler import WEBASSEMBLY_FLAGS, compiler_version
from hapticlink.orchestrator.base import interrupt, temporary_folders
from hapticlink.orchestrator.base.errors import Fault, InputFault
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.programs.build import components
from hapticlink.programs.page_program import webassembly, webassembly_files
from hapticlink.programs.ports import ports
from hapticlink.programs.resolve_scene import resolved
from hapticlink.visualization.browser_code import one_file
from hapticlink.visualization.live_and_standalone.prediction import predicted
from hapticlink.visualization.standalone.description import Description

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval' blob: data:; "
    "worker-src blob:; style-src 'unsafe-inline'; img-src data:"
)
"""Content security policy of the file: what is in it, and nothing from elsewhere."""
MODULE = "page.wasm"


def write(scene: Scene, name: str, path: Path) -> None:
    """Write the page of a scene that `viewed` has made. name: of the files that the page saves.
    Raises InputFault where the scene cannot become a program, with what stands in the way."""
    folders.ensure(path.parent, "--standalone")
    text = html(scene, name)
    with atomic_file(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def html(scene: Scene, name: str) -> str:
    """The page. The same scene gives the same bytes."""
    with temporary_folders.temporary_folder() as room:
        with resolved(scene, changing=True) as program:
            blocks = components(program)
            variables = ports(program, blocks)
            description = Description(program, variables, name)
            files = webassembly_files(program, blocks, variables, description.drawing)
        module = _compiled(files, room)
    verdict = predicted(scene, {}, description.parameters)
    description.data["map"] = {"type": "map"} | verdict
    contents = {
        "data": one_file.as_json(description.data).encode(),
        "worker": one_file.bundle("worker.js").encode(),
        "sound": one_file.bundle("sound_worklet.js").encode(),
        "program": module,
    }
    texts = {name: one_file.packed(content) for name, content in contents.items()}
    return one_file.page("index.html", texts, POLICY)


def _compiled(files: Mapping[str, str], room: Path) -> bytes:
    """The module of C files, from the cache where it is there, which keeps archives."""
    try:
        compiler = [compiler_version(), *WEBASSEMBLY_FLAGS]
        material = {"block": "page", "files": files, "compiler": compiler}

        def make(folder: Path) -> Path:
            path = folder / "page.fmu"
            with path.open("xb") as file:
                reproducible_zip.write({MODULE: webassembly(files, folder)}, file)
            return path

        path = cache.cached(material, make, room, interrupt.check)
        with zipfile.ZipFile(path) as archived:
            return archived.read(MODULE)
    except CompilerError as error:
        interrupt.check()
        raise Fault(str(error)) from error
    except FmuError as error:
        raise InputFault(str(error)) from error
