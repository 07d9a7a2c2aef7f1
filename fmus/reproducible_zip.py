"""Zip archives whose bytes depend on their files alone, and the hash of files."""

from __future__ import annotations

import hashlib
import uuid
import zipfile
from collections.abc import Mapping
from typing import BinaryIO

EPOCH = (1980, 1, 1, 0, 0, 0)  # the first date that a zip archive can hold
LEVEL = 3  # of zlib: less than half the time of its default, and a tenth larger


def write_zip(files: Mapping[str, bytes], target: BinaryIO) -> None:
    """Writes a zip archive whose bytes depend on `files` only: sorted names, a fixed date and
    system."""
    with zipfile.ZipFile(target, "w") as archive:
        for name in sorted(files):
            info = zipfile.ZipInfo(name, EPOCH)
            info.create_system = 3  # Unix, wherever it is written
            info.external_attr = 0o644 << 16
            archive.writestr(info, files[name], zipfile.ZIP_DEFLATED, LEVEL)


def digest(content: Mapping[str, bytes]) -> str:
    """SHA-256 of names and contents."""
    sha = hashlib.sha256()
    for name in sorted(content):
        sha.update(f"{name}\0{len(content[name])}\0".encode() + content[name])
    return sha.hexdigest()


def guid_of(sha: str) -> str:
    """The GUID of a hash."""
    return f"{{{uuid.UUID(sha[:32])}}}"
