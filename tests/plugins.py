"""Commands with plugins, each in a process of its own."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cache as once
from pathlib import Path

SERVER = """
import gc, json, os, shlex, sys
# Once for all commands of the tests: imports, the reader of scenes, the fonts of a figure.
import hapticlink.commands.run, hapticlink.orchestrator.experiment
import hapticlink.visualization.figures.run_figures
from matplotlib.figure import Figure
from hapticlink.commands import main
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.base.type_adapters import adapter
from hapticlink.visualization.figure_files import encode
adapter(Scene)
figure = Figure()
figure.subplots().set_title("warm")
figure.legend(figure.axes[0].plot([0.0, 1.0]), ["one"])
encode(figure, "png")
gc.set_threshold(200_000)  # as __main__ has it
gc.freeze()
for request in map(json.loads, sys.stdin):
    said = os.open(os.path.join(request["folder"], "said"), os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    child = os.fork()
    if not child:
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0), os.dup2(said, 1), os.dup2(said, 2)
        os.chdir(request["folder"])
        os.environ.clear(), os.environ.update(request["environment"])
        sys.path[:0] = request["path"]
        main(shlex.split(request["line"])[1:])
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    text = os.pread(said, os.fstat(said).st_size, 0).decode()
    os.close(said)
    print(json.dumps([status, text]), flush=True)
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
    request = {"folder": str(folder), "environment": environment, "path": [str(path)] * bool(path)}
    process = server()
    assert process.stdin
    assert process.stdout
    ended = []
    for line in lines:
        print(json.dumps(request | {"line": line}), file=process.stdin, flush=True)
        ended.append(Ended(*json.loads(process.stdout.readline())))
    return ended


@once
def server() -> subprocess.Popen[str]:
    """A process that has imported the package, forked for each command; it ends with this one."""
    return subprocess.Popen(
        [sys.executable, "-P", "-c", SERVER], env=os.environ | {"MPLBACKEND": "agg"},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
