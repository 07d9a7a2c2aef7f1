"""`hapticlink view`."""

from __future__ import annotations

import os
import secrets
import sys
import time
import webbrowser
from contextlib import ExitStack, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter, validators

from hapticlink.commands import completion
from hapticlink.commands.options import Map, Out, Set, Swap, default_folder, options
from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import Fault, InputFault, Interrupted
from hapticlink.orchestrator.base.terminal_output import say

if TYPE_CHECKING:
    from hapticlink.orchestrator.scene.scene import Scene
    from hapticlink.visualization.live.server_pipe import Link

Host = Annotated[
    str,
    Parameter(help="Address to serve on; any other than this one admits whoever knows the URL."),
]
Port = Annotated[
    int | None,
    Parameter(
        help="Port to serve on; by default 8512, or a free one if taken.",
        validator=validators.Number(gte=0, lte=65535),
    ),
]
Browser = Annotated[bool, Parameter(help="Open the page in the browser.")]
Second = Annotated[str | None, Parameter(help="Folder of a second run, beside the first.")]
Export = Annotated[
    Path | None,
    Parameter(
        help="Write the replay to this file: .html, which opens without a network, or an animation "
        "of the drawing, .gif, .webp or .png."
    ),
]
Standalone = Annotated[
    Path | None,
    Parameter(
        help="Write the page with the scene in it to this .html file, which needs no server."
    ),
]
PORT = 8512
WAIT = 0.1
"""Time (s) between two looks for Ctrl-C."""


def view(
    scene: Annotated[
        str,
        Parameter(
            help="Name of a shipped scene, path of a scene file or SSP, or folder of a run.",
            completer=completion.scenes,
        ),
    ],
    second: Second = None,
    /,
    *,
    out: Out = None,
    set: Set = None,
    swap: Swap = None,
    map: Map = None,
    host: Host = "127.0.0.1",
    port: Port = None,
    browser: Browser = True,
    export: Export = None,
    standalone: Standalone = None,
) -> int:
    """Show a scene that runs in real time on a page, where the mouse is the hand; Ctrl-C ends it.
    Recordings are written to OUT-1, OUT-2, ... (default runs/SCENE-view).

    With the folder of a run, or of two, replay them instead.

    For example:

        hapticlink view closed-loop
        hapticlink view closed-loop --standalone demo.html
        hapticlink view runs/closed-loop
        hapticlink view runs/on runs/off --export on-and-off.gif
    """
    if Path(scene).is_dir() and (second or export or not _is_scene(scene)):
        if set or swap or map or out:
            raise InputFault(
                f"{scene} is the folder of a run: --set, --swap and --out apply to scenes only"
            )
        if standalone:
            raise InputFault(f"--standalone: {scene} is the folder of a run; give a scene")
        return _replayed([scene, *([second] if second else [])], host, port, browser, export)
    if second or export:
        given = second or f"--export {export}"
        raise InputFault(
            f"{given}: {scene} is not the folder of a run; first `hapticlink run {scene}`, then "
            f"`hapticlink view {default_folder('runs', scene)}`"
        )
    import hapticlink as hl
    from hapticlink.visualization.live.session import Session
    from hapticlink.visualization.live.viewed_scene import viewed

    read = viewed(scene, options(set, swap, map))
    if standalone:
        return _written(read, scene, standalone)
    default = default_folder("runs", scene)
    root = out or default.with_name(f"{default.name}-view")
    token = secrets.token_urlsafe(16)
    with _served(host, port, token) as link:
        _shown(read.title, host, link.first["port"], token, browser)
        say("  the mouse is the hand, in place of the scene's; Ctrl-C ends it")
        session = Session(read, link, root, hl.RealTime)
        with suppress(Interrupted, hl.RunInterrupted):
            session.run()
    for folder in session.recordings:
        say(f"  {folder}/")
    return 0


def _written(scene: Scene, name: str, path: Path) -> int:
    """Write the page of a scene that needs no server."""
    from hapticlink.visualization.standalone import page

    if path.suffix.lower() != ".html":
        raise InputFault(f"--standalone {path}: name a file that ends in .html")
    page.write(scene, default_folder("", name).name, path)
    say(f"{path}: {path.stat().st_size / 1e3:.0f} kB; open it in a browser and drag")
    return 0


def _is_scene(name: str) -> bool:
    """Whether a folder's name is that of a shipped scene, and the folder has no run."""
    import hapticlink as hl

    return name in hl.shipped() and not (Path(name) / "run.json").exists()


def _replayed(
    folders: list[str], host: str, port: int | None, browser: bool, export: Path | None
) -> int:
    """Replay recorded runs on a page until Ctrl-C, or write them to a file."""
    from hapticlink.visualization.replay import replay_page, serve
    from hapticlink.visualization.replay.recorded_frames import Recorded

    if export:
        replay_page.require_written(export)
    runs = [Recorded(folder) for folder in folders]
    if export:
        replay_page.write(runs, export)
        say(f"{export}: {export.stat().st_size / 1e3:.0f} kB")
        return 0
    html, token = replay_page.html(runs), secrets.token_urlsafe(16)
    with ExitStack() as open_pages, suppress(Interrupted):
        try:
            at = open_pages.enter_context(
                serve.served(html, host, PORT if port is None else port, token)
            )
        except OSError as error:
            if port is not None:
                raise InputFault(_refused(host, port, error)) from None
            at = open_pages.enter_context(serve.served(html, host, 0, token))
        _shown(" beside ".join(folders), host, at, token, browser)
        say("  a replay, with a time slider; Ctrl-C ends it")
        while True:
            interrupt.check()
            time.sleep(WAIT)
    return 0


def _shown(title: str, host: str, port: int, token: str, browser: bool) -> None:
    """Say the page's address, and open it in a browser where there is a screen."""
    url = f"http://{f'[{host}]' if ':' in host else host}:{port}/{token}/"
    say(f"{title}: {url}")
    sys.stdout.flush()
    if browser and _has_screen():
        webbrowser.open(url)


def _refused(host: str, port: int | None, why: object) -> str:
    asked = f"--host {host}" if port is None else f"--host {host} --port {port}"
    return f"{asked}: {why}: choose another"


def _has_screen() -> bool:
    """Whether a browser would open a window of its own, and not take over the terminal."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _served(host: str, port: int | None, token: str) -> Link:
    """The server, on the port asked for. Raises InputFault where it cannot start."""
    if not find_spec("websockets"):
        raise InputFault(f"the page needs the package websockets: {install_command('view')}")
    from hapticlink.visualization.live.server_pipe import Link

    module = "hapticlink.visualization.live.server"
    made = Link(module, host, str(PORT if port is None else port), token)
    if port is None and made.first and "error" in made.first:
        made = Link(module, host, "0", token)
    if made.first is None:
        raise Fault("the page's server does not start")
    if "error" in made.first:
        raise InputFault(_refused(host, port, made.first["error"]))
    return made
