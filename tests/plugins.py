"""Commands with plugins, each in a process of its own."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

RUNNER = """
import json, os, shlex, sys
# Once for all.
import hapticlink.orchestrator.experiment, hapticlink.visualization.figures.run_figures
from hapticlink.commands import main
for line in json.load(sys.stdin):
    with open("said", "w+") as said:
        child = os.fork()
        if not child:
            os.dup2(said.fileno(), 1), os.dup2(said.fileno(), 2)
            main(shlex.split(line)[1:])
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        said.seek(0)
        print(json.dumps([status, said.read()]), flush=True)
"""


@dataclass
class Ended:
    status: int
    said: str


def hapticlink(
    folder: Path, *lines: str, path: Path | None = None, cache: Path | None = None
) -> list[Ended]:
    """Each line, `hapticlink run ...`, in a process of its own in `folder`, as the command would:
    the folder itself is not on Python's path, `path` is. cache: of FMUs, if not the usual one."""
    environment = os.environ | {"MPLBACKEND": "agg"}
    if path:
        environment["PYTHONPATH"] = f"{path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    if cache:
        environment["HAPTICLINK_CACHE"] = str(cache)
    done = subprocess.run(
        [sys.executable, "-P", "-c", RUNNER], cwd=folder, env=environment, check=True,
        input=json.dumps(lines), capture_output=True, text=True,
    )  # fmt: skip
    return [Ended(*json.loads(line)) for line in done.stdout.splitlines()]
