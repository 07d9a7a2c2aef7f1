"""The process of the second of two runs under one mouse on the page of `hapticlink view`."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path

from hapticlink.orchestrator.base.errors import Fault, Interrupted
from hapticlink.visualization.live_and_standalone.viewed_scene import unpack_scene
from hapticlink.visualization.live_page.server_pipe import Pipe, read_message, to_caller


def main() -> None:
    """Run the scene with the settings, which the caller sends first, until it has ended. It waits
    at its start until the caller lets it go on."""
    out = to_caller()
    if (arguments := read_message(sys.stdin.buffer)) is None:
        return
    link = Pipe(sys.stdin.buffer, out)
    import hapticlink as hl
    from hapticlink.visualization.live_page.session import LiveSession

    root, scene, settings = arguments
    with suppress(Fault, Interrupted):  # the page's server has ended
        LiveSession(unpack_scene(scene), link, Path(root), hl.RealTime, settings, paused=True).run()


if __name__ == "__main__":
    main()
