"""Opens FMUs and SSPs, which are untrusted zip archives with XML, only if no entry can be written
outside its folder or expand without limit."""

from __future__ import annotations

import stat
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import BinaryIO
from xml.parsers import expat

from hapticlink.fmus.cache import is_whole
from hapticlink.orchestrator.base.errors import InputFault

MAX_XML_BYTES = 256 * 2**20
"""Bytes of one XML entry; the largest FMUs (10^5 variables) have some 50 MB."""
MAX_BYTES = 2**30
"""Bytes of an archive once it is unpacked."""
MAX_ENTRIES = 10_000


@contextmanager
def open_archive(
    path: Path, kind: str, content: BinaryIO | None = None
) -> Iterator[zipfile.ZipFile]:
    """The archive at `path`, a `kind` ("FMU"), or the `content` of that place in another one.
    Raises InputFault where it is missing, damaged, larger than MAX_BYTES or MAX_ENTRIES, or holds
    an entry that would land outside the folder that it is unpacked to."""
    try:
        if path.exists() and not path.is_file():  # a pipe, which may never be written to
            raise InputFault(f"{path}: not a regular file; give the path of an {kind}")
        with zipfile.ZipFile(content or path) as archive:
            archive.filename = str(path)
            entries = archive.infolist()
            for entry in entries:
                if fault := _outside(entry, kind):
                    raise InputFault(f"{path}: entry {entry.orig_filename!r} {fault}")
            if fault := _too_large(entries):
                raise InputFault(
                    f"{path}: {fault} are unpacked; take out what no run needs: sources, "
                    "documentation, binaries of other platforms"
                )
            yield archive
    except FileNotFoundError:
        raise InputFault(f"{path}: there is no such file; give the path of an {kind}") from None
    except OSError as error:
        raise InputFault(f"{path}: cannot be read: {error.strerror or error}") from error
    except (zipfile.BadZipFile, EOFError, zlib.error, NotImplementedError, RuntimeError) as error:
        raise InputFault(f"{path}: damaged, not a readable zip archive ({error})") from error


def _outside(entry: zipfile.ZipInfo, kind: str) -> str:
    """The reason to refuse an entry of a `kind` ("FMU"), with the remedy; "" if there is none."""
    name = entry.orig_filename
    nowhere = f"take no {kind} from there"
    if name.startswith("/") or ".." in PurePosixPath(name.replace("\\", "/")).parts:
        return f"points outside the archive; {nowhere}"
    if ":" in name or "\0" in name:
        return f"is not a path with forward slashes; {nowhere}"
    if "\\" in name:  # some tools write it on Windows
        return f"has a backslash, where a zip archive has forward slashes; pack the {kind} again"
    if stat.S_ISLNK(entry.external_attr >> 16):
        return f"is a symbolic link; {nowhere}"
    return ""


def _too_large(entries: list[zipfile.ZipInfo]) -> str:
    """The reason to refuse an archive for its size, "" if there is none. The sizes that it declares
    for its entries are reliable: never more is read of an entry."""
    if (size := sum(entry.file_size for entry in entries)) > MAX_BYTES:
        return f"it has {size} bytes unpacked; at most {MAX_BYTES}"
    if len(entries) > MAX_ENTRIES:
        return f"it has {len(entries)} entries; at most {MAX_ENTRIES}"
    return ""


def require_whole(archive: zipfile.ZipFile) -> None:
    """Raises InputFault if the content of an entry of an FMU does not match its CRC-32."""
    path = Path(archive.filename or "")
    file = path.stat()
    if is_whole(path, file.st_mtime_ns, file.st_size):  # as known of those from the cache
        return
    if (damaged := archive.testzip()) is not None:
        raise InputFault(f"{archive.filename}: damaged: entry {damaged!r} has another checksum")


def read_xml(archive: zipfile.ZipFile, entry: str) -> bytes:
    """An XML entry, well-formed and without a document type: neither FMI nor SSP has one, and
    entities that expand without end need one. Raises InputFault."""
    path = archive.filename
    try:
        info = archive.getinfo(entry)
    except KeyError:
        raise InputFault(f"{path}: holds no {entry}") from None
    if info.file_size > MAX_XML_BYTES:
        raise InputFault(
            f"{path}: {entry} has {info.file_size} bytes; at most {MAX_XML_BYTES} are read"
        )
    text = archive.read(info)
    require_plain_xml(text, f"{path}: {entry}")
    return text


def require_plain_xml(text: bytes, what: str) -> None:
    """Raises InputFault for XML, called `what`, that is not well-formed or has a document type."""
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise InputFault(f"{what} declares a document type, which may expand without end")

    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, LookupError, ValueError) as error:  # of an encoding, the last two
        raise InputFault(f"{what} is not well-formed XML: {error}") from error
