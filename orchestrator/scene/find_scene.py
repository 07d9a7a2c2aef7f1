"""Finds scenes: files, and those shipped with the package."""

from __future__ import annotations

import importlib.resources
from functools import cache
from pathlib import Path as FilePath
from typing import Any

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault, near, shorten
from hapticlink.orchestrator.scene.toml_keys import LARGEST

PACKAGES = {"scene": "hapticlink.scenes", "device": "hapticlink.scenes.devices"}
"""Where the files are that are shipped, by what they are."""


@cache
def list_shipped(what: str = "scene") -> dict[str, Any]:
    """The TOML files that are shipped with the package, of scenes by default, by name."""
    folder = importlib.resources.files(PACKAGES[what])
    names = (entry for entry in folder.iterdir() if entry.name.endswith(".toml"))
    files = {entry.name.removesuffix(".toml"): entry for entry in names}
    return dict(sorted(files.items()))


@cache
def _read_shipped(name: str, what: str) -> str:
    text: str = list_shipped(what)[name].read_text(encoding="utf-8")
    return text


def find_scene(
    scene: str, folder: FilePath | None = None, what: str = "scene"
) -> tuple[str, str, FilePath | None]:
    """Name, text and folder of a scene, or of a device: a path relative to `folder`, or the name of
    a shipped one, which has no folder. Raises InputFault where there is none, or where it cannot be
    read as text."""
    path, known = (folder or FilePath()) / scene, list_shipped(what)
    if text_files.exists(path):
        return path.stem, text_files.read_text(path, f"a {what}", LARGEST), path.parent
    if scene in known:
        return scene, _read_shipped(scene, what), None
    raise InputFault(f"{shorten(scene)}: neither a file nor a shipped {what}; {near(scene, known)}")
