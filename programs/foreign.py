"""An FMU of others in a program: its C sources, with a prefix on all names that the linker sees.

An FMU of FMI 2.0 that brings its sources lists in SourceFiles those to compile (FMI 2.0.5 sections
2.3 and 4.3.1). Which names they define, the compiler knows: a macro renames each. The headers of
the standard are no part of an FMU; those that its sources include give the same prefix.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

from hapticlink.fmus.errors import CompilerError
from hapticlink.fmus.native.compiler import FMI2_HEADERS, HEADERS, global_names
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.archive import open_archive, read_xml
from hapticlink.orchestrator.fmi.description import Description

_EXPORTS = ("__declspec(dllexport)", '__attribute__ ((visibility ("default")))')
_PLAIN = "#define fmi2FullName(name) name"


@dataclass(frozen=True)
class Foreign:
    """An FMU with its sources. files: those of sources/, by path there. compiled: the C files among
    them that are compiled by themselves. resources: files by path in resources/."""

    description: Description
    files: Mapping[str, bytes]
    compiled: tuple[str, ...]
    resources: Mapping[str, bytes]

    def sources(self, id_: str, required: set[str]) -> dict[str, str]:
        """The C files by name: its own in a folder `id_`, and for each to compile one that includes
        it, with all names that the linker sees beginning with `id_`.

        required: the FMI functions that a program calls. Raises InputFault where one is not
        defined, or a file does not compile.
        """
        files = {f"{id_}/{name}": text for name, text in self._texts(id_).items()}
        names = f"{id_}_names.h"
        for i, name in enumerate(self.compiled):
            files[f"{id_}_{i:03}.c"] = f'#include "{names}"\n#include "{id_}/{name}"\n'
        defined = self._defined(files | {names: ""})
        given = {name: self._with_prefix(name, id_) for name in defined}
        if missing := sorted(required - {n.removeprefix(f"{id_}_") for n in given.values()}):
            raise InputFault(
                f"{self.description.path}: its sources do not define {', '.join(missing)}; every "
                "FMU of FMI 2.0 has these functions"
            )
        rows = [f"#define {name} {new}\n" for name, new in given.items() if name != new]
        return {**files, names: "".join(rows)}

    def _texts(self, id_: str) -> dict[str, str]:
        """Its files, and beside each that is compiled the headers of the standard."""
        texts = {name: content.decode(errors="replace") for name, content in self.files.items()}
        folders = {PurePosixPath(name).parent for name in self.compiled}
        headers = {str(folder / name) for folder in folders for name in FMI2_HEADERS}
        headers |= {name for name in texts if PurePosixPath(name).name in FMI2_HEADERS}
        return texts | {name: _header(PurePosixPath(name).name, id_) for name in headers}

    def _with_prefix(self, name: str, id_: str) -> str:
        """The new name of one that the sources define; those of FMI functions may begin with the
        FMU's own prefix (FMI 2.0.5 section 2.1.1)."""
        if name.startswith(f"{id_}_"):
            return name
        own = name.removeprefix(f"{self.description.identifier}_")
        return f"{id_}_{own if own.startswith('fmi2') else name}"

    def _defined(self, files: Mapping[str, str]) -> list[str]:
        with tempfile.TemporaryDirectory() as folder:
            room = Path(folder)
            try:
                return global_names(write_files(files, room), room)
            except CompilerError as error:
                raise InputFault(f"{self.description.path}: of its sources, {error}") from error


def write_files(files: Mapping[str, str], folder: Path) -> list[Path]:
    """Writes C files, by path, into a folder; returns those to compile, the largest first."""
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return sorted(folder.glob("*.c"), key=lambda path: -path.stat().st_size)


def _header(name: str, id_: str) -> str:
    """A header of the standard, which gives all functions a prefix and exports none."""
    text = (HEADERS / name).read_text(errors="replace")
    for export in _EXPORTS:
        text = text.replace(export, "")
    return text.replace(_PLAIN, f"#define fmi2FullName(name) {id_}_ ## name")


def read_foreign(description: Description) -> Foreign:
    """An FMU with its sources. Raises InputFault, with the reason alone, where they cannot be
    compiled into a program."""
    if description.fmi != "2":
        raise InputFault(f"it is of FMI {description.fmi}.0; only those of FMI 2.0 are compiled in")
    if description.equations:
        raise InputFault("it is run by model exchange, and a program has no solver")
    with open_archive(description.path, "FMU") as archive:
        tree = ElementTree.fromstring(read_xml(archive, "modelDescription.xml"))
        listed = [f.get("name", "") for f in tree.iterfind("./CoSimulation/SourceFiles/File")]
        if not listed:
            raise InputFault(
                "it brings no C sources: its modelDescription.xml lists none as SourceFiles of "
                "CoSimulation"
            )
        entries = {e: archive.read(e) for e in archive.namelist() if not e.endswith("/")}
    files, resources = _within("sources/", entries), _within("resources/", entries)
    for name in listed:
        if not re.fullmatch(r".+\.c", name):
            raise InputFault(f"{name!r} of its sources is no C file")
        if name not in files:
            raise InputFault(f"it lists sources/{name}, which is not in it")
    return Foreign(description, files, tuple(listed), resources)


def _within(folder: str, entries: Mapping[str, bytes]) -> dict[str, bytes]:
    return {e.removeprefix(folder): c for e, c in entries.items() if e.startswith(folder)}
