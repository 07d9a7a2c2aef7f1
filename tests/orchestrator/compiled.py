"""C files of the tests as shared libraries."""

import tempfile
from functools import cache
from pathlib import Path

from fmpy import sharedLibraryExtension

from hapticlink.fmus.native import compile_library


def compiled(source: Path | str, folder: Path, name: str, *options: str) -> Path:
    """A C file, by default one of this folder, with all its functions exported."""
    library = folder / f"{name}{sharedLibraryExtension}"
    library.write_bytes(_compiled(Path(__file__).parent / source, options))
    return library


@cache
def _compiled(source: Path, options: tuple[str, ...]) -> bytes:
    with tempfile.TemporaryDirectory() as room:
        exported = ["-fvisibility=default", *options]
        return compile_library(source, Path(room) / "library", options=exported).read_bytes()
