from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands.options import UNCHANGED, Scene, SceneOptions
from hapticlink.orchestrator.base.terminal_output import say
from hapticlink.orchestrator.network import key_file

Key = Annotated[
    Path,
    Parameter(help="File of the key that both computers need; the first serve makes it."),
]


def serve(
    scene: Scene,
    /,
    *,
    changes: SceneOptions = UNCHANGED,
    part: Annotated[
        str, Parameter(help="What to serve: an FMU, or all FMUs at a rate, such as graphics.")
    ] = "graphics",
    listen: Annotated[
        str, Parameter(help="HOST:PORT to serve at; HOST is an address of this computer.")
    ] = "127.0.0.1:5555",
    key: Key = key_file.DEFAULT,
) -> int:
    """Serve FMUs of a scene to a run on another computer, one run after the other, until Ctrl-C.

    The run has the same scene with the same options, and a copy of the key's file. For example:

        hapticlink serve closed-loop --part graphics --listen 192.168.1.2:5555
        hapticlink run closed-loop --real-time --remote graphics=192.168.1.2:5555
    """
    import hapticlink as hl
    from hapticlink.orchestrator.network import served_part
    from hapticlink.orchestrator.system.build_system import build_system

    served_part.require_address(listen)
    if key_file.create(key):
        say(f"{key}: a new key, which the other computer needs: copy it by a safe way")
    from hapticlink.orchestrator.network.server import Server  # which needs an extra's libraries

    secret, read = key_file.read_key(key), hl.scene(scene, changes.options)
    with build_system(read) as system:
        names = served_part.fmus_of(system, part)
        served = {n: (system.fmu[n], served_part.identity(read, system.fmu[n])) for n in names}
        server = Server(served, read.faults, _say)
        _say(f"{read.title}: {', '.join(names)}")
        try:
            server.serve(listen, secret)
        finally:
            server.close()
    if server.refused:
        say(f"{server.refused.total()} messages were refused")
    return 0


def _say(text: str) -> None:
    say(text)
    sys.stdout.flush()
