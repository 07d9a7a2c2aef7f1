"""`hapticlink view`."""

from __future__ import annotations

import os
import secrets
import sys
import webbrowser
from contextlib import suppress
from importlib.util import find_spec
from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.faults import Fault, InputFault, Interrupted
from hapticlink.orchestrator.base.say import say
from hapticlink.orchestrator.commands.options import Out, Scene, Set, Swap, default_folder, options
from hapticlink.orchestrator.view.link import Link

Host = Annotated[
    str,
    Parameter(help="Address to serve on; others than this let in who knows the URL."),
]
Port = Annotated[
    int | None,
    Parameter(help="Port to serve on; by default 8512, or a free one if taken."),
]
Browser = Annotated[bool, Parameter(help="Open the page in the browser.")]
PORT = 8512


def view(
    scene: Scene,
    /,
    *,
    out: Out = None,
    set: Set = None,
    swap: Swap = None,
    host: Host = "127.0.0.1",
    port: Port = None,
    browser: Browser = True,
) -> int:
    """Show a scene that runs in real time on a page, where the mouse is the hand; Ctrl-C ends it.
    Recordings are written to OUT-1, OUT-2, ... (default runs/SCENE-view)."""
    from hapticlink.orchestrator import api
    from hapticlink.orchestrator.view.scene import viewed
    from hapticlink.orchestrator.view.session import Session

    read = viewed(scene, options(set, swap))
    default = default_folder("runs", scene)
    root = out or default.with_name(f"{default.name}-view")
    token = secrets.token_urlsafe(16)
    with _served(host, port, token) as link:
        url = f"http://{f'[{host}]' if ':' in host else host}:{link.first['port']}/{token}/"
        say(f"{read.title}: {url}")
        say("  the mouse is the hand, in place of the scene's; Ctrl-C ends it")
        if browser and _has_screen():
            webbrowser.open(url)
        session = Session(read, link, root)
        with suppress(Interrupted, api.RunInterrupted):
            session.run()
    for folder in session.recordings:
        say(f"  {folder}/")
    return 0


def _has_screen() -> bool:
    """Whether a browser would open a window of its own, and not take over the terminal."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _served(host: str, port: int | None, token: str) -> Link:
    """The server, on the port asked for. Raises InputFault where it cannot start."""
    if not find_spec("websockets"):
        raise InputFault("the page needs the package websockets: pip install 'hapticlink[view]'")
    module = "hapticlink.orchestrator.view.server"
    made = Link(module, host, str(PORT if port is None else port), token)
    if port is None and made.first and "error" in made.first:
        made = Link(module, host, "0", token)
    if made.first is None:
        raise Fault("the page's server does not start")
    if "error" in made.first:
        at = f"--host {host}" + (f" --port {port}" if port is not None else "")
        raise InputFault(f"{at}: {made.first['error']}: take another")
    return made
