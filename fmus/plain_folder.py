"""Where FMUs are unpacked: a folder whose path reads the same in the URI of its resources.

An importer hands an FMU of FMI 2.0 its resources as a URI (section 2.1.5), in which all characters
but letters and digits of ASCII and -._~/ are written as %XX. The library of pythonfmu 0.7 undoes
%20, the space, alone: with any other of them it finds no module, and ends its host by SIGSEGV.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from hapticlink.fmus.errors import FmuError

PLAIN = re.compile(r"[A-Za-z0-9._~/\\: -]+" if sys.platform == "win32" else r"[A-Za-z0-9._~/ -]+")


def find_unpacking_folder() -> str:
    """The folder for temporary files, or where its path is not plain, another one for them whose
    path is, if there is one that can be written to."""
    usual = tempfile.gettempdir()
    able = (
        f for f in (usual, *_others()) if PLAIN.fullmatch(f) and os.access(f, os.W_OK | os.X_OK)
    )
    return next(able, usual)


def _others() -> Iterator[str]:
    if sys.platform == "win32":
        yield str(Path(os.environ.get("SYSTEMROOT", r"C:\Windows"), "Temp"))
        yield os.environ.get("PUBLIC", r"C:\Users\Public")
    else:
        yield from ("/tmp", "/var/tmp", "/dev/shm")


def require_plain(folder: str | Path) -> None:
    """Raises FmuError where a Python FMU that is unpacked in `folder` would end this process."""
    if (Path(folder) / "resources" / "slavemodule.txt").exists() and not PLAIN.fullmatch(
        str(folder)
    ):
        odd = sorted({*re.sub(PLAIN, "", str(folder))})
        raise FmuError(
            f"a Python FMU cannot be loaded from {folder}: its library does not read "
            f"{' '.join(odd)} in a path; set TMPDIR to a folder whose path has letters of ASCII, "
            "digits, spaces and - . _ ~ alone, or take a native FMU (packaging = 'native')"
        )
