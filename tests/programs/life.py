"""The life of two instances of a program, by life.c for FMI 2.0 and life3.c for FMI 3.0."""

import os
import re
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.programs import built

SOURCES = {2: Path(__file__).with_name("life.c"), 3: Path(__file__).with_name("life3.c")}
"""By version of FMI."""


def made(
    compiler: str,
    sources: Mapping[str, bytes],
    fmi: int,
    folder: Path,
    flags: Sequence[str] = built.FLAGS,
) -> Path:
    """The life with the C files of a program."""
    whole = {**sources, "life.c": SOURCES[fmi].read_bytes()}
    return built.linked(compiler, whole, folder / "life", flags)


def lived(
    command: Sequence[str | Path], description: str, environment: Mapping[str, str] = os.environ
) -> float:
    """The sum of all variables after the life that the command runs. description: the text of
    modelDescription.xml, whose identifier, variables and haptic rate (512 Hz) the life needs."""
    identifier = re.search(r'(?:guid|Token)="(.*?)"', description)
    assert identifier
    references = map(int, re.findall(r'valueReference="(\d+)" desc', description))
    arguments = [*command, identifier[1], str(1 + max(references)), repr(1 / 512)]
    done = subprocess.run(
        arguments, capture_output=True, text=True, check=False, env=environment, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return float(done.stdout.rpartition(" ")[2])
