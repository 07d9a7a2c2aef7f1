from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.terminal_output import say

Name = Annotated[str, Parameter(help="Name of the scene, or path of its file.")]


def new(name: Name, /) -> int:
    """Write NAME.toml, a commented scene to change: a four-bar in the whole loop, with device,
    controller and hand. An existing file is left alone.

    For example:

        hapticlink new crane && hapticlink run crane.toml
    """
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    text = files(__package__).joinpath("new_scene.toml").read_text(encoding="utf-8")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text.replace("@NAME@", path.stem))
    except FileExistsError:
        raise InputFault(f"{path} exists: choose another name, or move it away") from None
    except (FileNotFoundError, NotADirectoryError):
        raise InputFault(f"{path}: there is no folder {path.parent}: make it first") from None
    say(f"{path}: try `hapticlink run {path}`, then change it")
    return 0
