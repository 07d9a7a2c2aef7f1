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
from hapticlink.programs.page_program import compile_page, write_page_sources
from hapticlink.programs.ports import ports
from hapticlink.programs.resolve_scene import resolve_scene
from hapticlink.visualization.browser_code import one_file
from hapticlink.visualization.live_and_standalone.prediction import predict_stability
from hapticlink.visualization.standalone.description import PageDescription

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval' blob: data:; "
    "worker-src blob:; style-src 'unsafe-inline'; img-src data:"
)
"""Content security policy of the file: what is in it, and nothing from elsewhere."""
MODULE = "page.wasm"


def write_page(scene: Scene, name: str, path: Path) -> None:
    """Write the page of a scene of `load_viewed_scene`. name: of the files that the page saves.
    Raises InputFault where the scene cannot become a program, with what stands in the way."""
    folders.ensure(path.parent, "--standalone")
    text = html(scene, name)
    with atomic_file(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def html(scene: Scene, name: str) -> str:
    """The page. The same scene gives the same bytes."""
    with temporary_folders.temporary_folder() as room:
        with resolve_scene(scene, changing=True) as program:
            blocks = components(program)
            variables = ports(program, blocks)
            description = PageDescription(program, variables, name)
            offered = description.data["parameters"]
            files = write_page_sources(program, blocks, variables, description.drawing, offered)
        module = _compile_page(files, room)
    verdict = predict_stability(scene, {}, description.parameters)
    description.data["map"] = {"type": "map"} | verdict
    contents = {
        "data": one_file.as_json(description.data).encode(),
        "worker": one_file.bundle("worker.js").encode(),
        "sound": one_file.bundle("sound_worklet.js").encode(),
        "program": module,
    }
    texts = {name: one_file.pack_text(content) for name, content in contents.items()}
    return one_file.page("index.html", texts, POLICY)


def _compile_page(files: Mapping[str, str], room: Path) -> bytes:
    """The module of C files, from the cache where it is there, which keeps archives."""
    try:
        compiler = [compiler_version(), *WEBASSEMBLY_FLAGS]
        material = {"block": "page", "files": files, "compiler": compiler}

        def make(folder: Path) -> Path:
            path = folder / "page.fmu"
            with path.open("xb") as file:
                reproducible_zip.write_zip({MODULE: compile_page(files, folder)}, file)
            return path

        path = cache.get_or_build(material, make, room, interrupt.raise_if_interrupted)
        with zipfile.ZipFile(path) as archived:
            return archived.read(MODULE)
    except CompilerError as error:
        interrupt.raise_if_interrupted()
        raise Fault(str(error)) from error
    except FmuError as error:
        raise InputFault(str(error)) from error
