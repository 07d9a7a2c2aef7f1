"""Options that several commands share."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from hapticlink.commands import completion
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.terminal_output import say

Scene = Annotated[
    str,
    Parameter(
        help="Name of a shipped scene, or path of a scene file or SSP.",
        completer=completion.scenes,
    ),
]


def repeatable(help: str, **more: Any) -> Parameter:
    """An option that is given once for each of its values."""
    return Parameter(consume_multiple=False, negative="", help=f"{help}; repeatable.", **more)


Set = Annotated[
    list[str] | None,
    repeatable("key=value, a dotted key of the scene file", completer=completion.keys),
]
Swap = Annotated[
    list[str] | None,
    repeatable("block=file.fmu, an FMU that replaces a block of the haptic loop, or block=mujoco"),
]
Map = Annotated[
    list[str] | None,
    repeatable(
        "port=variable,... of an FMU of --swap whose variables have other names, signs or scales "
        "(F=-tau_{x,y,z}, x=pos*0.001); with several FMUs block.port=..."
    ),
]
Format = Annotated[
    str, Parameter(help="Formats of figures: png, pdf or svg, several with commas between.")
]
Out = Annotated[Path | None, Parameter(help="Folder to write to.")]
Quiet = Annotated[
    bool, Parameter(negative="", help="Print warnings and errors only, on standard error.")
]
Json = Annotated[
    bool, Parameter(negative="", help="Print the result as one JSON document and nothing else.")
]


@Parameter(name="*")
@dataclass(frozen=True)
class SceneOptions:
    """The changes of a scene that a command is given."""

    set: Set = None
    swap: Swap = None
    map: Map = None

    @property
    def options(self) -> tuple[str, ...]:
        """The options of the scene: an [[fmu]] with `replaces` for each --swap, what --map says of
        them, then those of --set, which may change them. Raises InputFault for a swap that is not
        block=file, and a map that is not port=names."""
        swaps = tuple(self.swap or ())
        maps = (_map(each, swaps) for each in self.map or ())
        return (*map(_swap, swaps), *maps, *(self.set or ()))

    def folder(self, root: str, scene: str) -> Path:
        """The default output folder for these changes of a scene."""
        given = (*(self.set or ()), *(self.swap or ()), *(self.map or ()))
        return default_folder(root, scene, given)


UNCHANGED = SceneOptions()


@Parameter(name="*")
@dataclass(frozen=True)
class Output:
    """Where a command writes, and what it prints."""

    out: Out = None
    quiet: Quiet = False
    json: Json = False

    def show(self, head: str, lines: Iterable[str], record: Mapping[str, Any]) -> None:
        """Print a result: its first line, then the others, indented; as `print_result`."""
        print_result((head, *(f"  {line}" for line in lines)), record, self.quiet, self.json)


PRINTED = Output()


def _swap(given: str) -> str:
    from hapticlink.orchestrator.scene import overrides  # with all of a scene, slow to load

    block, equals, file = given.partition("=")
    if not (block and equals and file):
        raise InputFault(f"--swap {given}: write block=file.fmu, e.g. --swap controller=my.fmu")
    by = {"engine": file} if file == "mujoco" else {"path": str(Path(file).resolve())}
    return f"fmu.+={overrides.text({'replaces': block} | by, '--swap')}"


def _map(given: str, swaps: Sequence[str]) -> str:
    from hapticlink.orchestrator.scene import overrides  # with all of a scene, slow to load

    port, equals, names = given.partition("=")
    blocks = [swap.partition("=")[0] for swap in swaps]
    block, dot, _ = port.partition(".")
    if not (dot and block in blocks) and len(blocks) == 1:
        (block,), port = blocks, f"{blocks[0]}.{port}"
    if not (port and equals and names) or block not in blocks:
        example = f"{blocks[0] if blocks else 'hand'}.F=force0,force1,force2"
        raise InputFault(
            f"--map {given}: write port=variable,... of a --swap, e.g. --map {example}"
        )
    # At commas outside of the braces of tau_{x,y} and of the brackets of M[1,2].
    listed = re.split(r",(?![^{]*\})(?![^\[]*\])", names)
    variables = overrides.text([name.strip() for name in listed], "--map")
    return f'fmu.{block}.map."{port.removeprefix(f"{block}.")}"={variables}'


LONGEST = 100
"""Characters of options in the name of a folder."""


def title(scene: str) -> str:
    """What messages and folders call a scene, by its name or path."""
    path = Path(scene)
    if path.suffix == ".state":
        return f"{path.absolute().parent.name}-from-{path.stem}"
    return path.stem if path.suffix in (".toml", ".ssp", ".xml") else path.name


def default_folder(root: str, scene: str, options: Iterable[str] = ()) -> Path:
    """The default output folder for a scene's name or path: `<root>/<scene>`, and with options
    `<root>/<scene>,key=value,...`, so that a run does not replace one of other options.

    Quotes, brackets and spaces behind commas are left out; where options hold other characters that
    are not for file names, or many, the name ends with the start of their sha256.
    """
    name = title(scene)
    given = re.sub(r"['\"\[\]]|(?<=,) +", "", ",".join(options))
    if given:
        plain = re.sub(r"[^\w.=,+-]", "_", given)[:LONGEST]
        mark = "" if plain == given else f"-{hashlib.sha256(given.encode()).hexdigest()[:8]}"
        name += f",{plain}{mark}"
    return Path(root) / name


def print_result(
    lines: Iterable[str], record: Mapping[str, Any], quiet: bool, as_json: bool
) -> None:
    """Print the lines of a result; or with `as_json` its record alone; or with `quiet` nothing."""
    if as_json:
        print(json.dumps(record, indent=2))
    elif not quiet:
        say(*lines, sep="\n")
