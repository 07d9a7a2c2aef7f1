"""A scene as a page in one file: the page that `view` serves, with the scene as WebAssembly."""

from __future__ import annotations

import base64
import gzip
from pathlib import Path

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.errors import CompilerError, FmuError
from hapticlink.orchestrator.base import interrupt, temporary_folders
from hapticlink.orchestrator.base.faults import Fault, InputFault
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.programs.build import components
from hapticlink.programs.page_program import webassembly
from hapticlink.programs.ports import ports
from hapticlink.programs.resolved import resolved
from hapticlink.visualization.replay import one_file
from hapticlink.visualization.standalone.description import Description

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval' blob:; worker-src blob:; "
    "style-src 'unsafe-inline'; img-src data:"
)
"""Content security policy of the file: what is in it, and nothing from elsewhere."""


def write(scene: Scene, name: str, path: Path) -> None:
    """Write the page of a scene that `viewed` has made. name: of the files that the page saves.
    Raises InputFault where the scene cannot become a program, with what stands in the way."""
    folders.ensure(path.parent, "--standalone")
    text = html(scene, name)
    with atomic_file(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def html(scene: Scene, name: str) -> str:
    """The page. The same scene gives the same bytes."""
    with temporary_folders.room() as room, resolved(scene, changing=True) as program:
        made = components(program)
        variables = ports(program, made)
        description = Description(program, variables, name)
        try:
            module = webassembly(program, made, variables, description.drawing, room)
        except CompilerError as error:
            interrupt.check()
            raise Fault(str(error)) from error
        except FmuError as error:
            raise InputFault(str(error)) from error
    packed = base64.b64encode(gzip.compress(module, 9, mtime=0)).decode()
    extra = {"worker": one_file.bundle("worker.js"), "program": packed}
    return one_file.page("index.html", description.data, extra, POLICY)
