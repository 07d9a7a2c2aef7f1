from __future__ import annotations

import secrets
import time
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands import completion
from hapticlink.commands.options import UNCHANGED, Out, SceneOptions, default_folder
from hapticlink.commands.page_server import LOCAL, PageAddress
from hapticlink.commands.progress import waiting
from hapticlink.commands.run import Device
from hapticlink.commands.stop_key import wait_for_enter
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import InputFault, Interrupted
from hapticlink.orchestrator.base.terminal_output import say

FIRST = "closed-loop-direct"
"""The scene that is shown where none is named: in it the rate is felt."""
WAIT = 0.1
"""Time (s) between two looks for Ctrl-C."""
Speed = Annotated[
    float, Parameter(help="Simulated seconds in one of the wall clock: 0.2 is slow motion.")
]
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


def view(
    scene: Annotated[
        str,
        Parameter(
            help="Name of a shipped scene, path of a scene file or SSP, or folder of a run.",
            completer=completion.scenes,
        ),
    ] = FIRST,
    second: Second = None,
    /,
    *,
    out: Out = None,
    changes: SceneOptions = UNCHANGED,
    device: Device = None,
    address: PageAddress = LOCAL,
    speed: Speed = 1.0,
    export: Export = None,
    standalone: Standalone = None,
) -> int:
    """Show a scene that runs in real time on a page, where the mouse is the hand; Ctrl-C ends it.
    Recordings are written to OUT-1, OUT-2, ... (default runs/SCENE-view).

    With the folder of a run, or of two, replay them instead.

    For example:

        hapticlink view
        hapticlink view closed-loop
        hapticlink view closed-loop --standalone demo.html
        hapticlink view closed-loop --device /dev/ttyACM0
        hapticlink view runs/closed-loop
        hapticlink view runs/on runs/off --export on-and-off.gif
    """
    if Path(scene).is_dir() and (second or export or not _is_scene(scene)):
        if changes != UNCHANGED or out or speed != 1.0:
            raise InputFault(
                f"{scene} is the folder of a run: --set, --swap, --speed and --out apply to scenes "
                "only"
            )
        if standalone:
            raise InputFault(f"--standalone: {scene} is the folder of a run; give a scene")
        return _replay([scene, *([second] if second else [])], address, export)
    if second or export:
        given = second or f"--export {export}"
        raise InputFault(
            f"{given}: {scene} is not the folder of a run; first `hapticlink run {scene}`, then "
            f"`hapticlink view {default_folder('runs', scene)}`"
        )
    if standalone:
        if speed != 1.0:
            raise InputFault(
                f"--speed {speed:g}: the page in one file has a control for it, and its address "
                f"does it: {standalone}#speed={speed:g}"
            )
        return _write_page(scene, changes, standalone)
    default = default_folder("runs", scene)
    root = out or default.with_name(f"{default.name}-view")
    token = secrets.token_urlsafe(16)
    second_run = "hapticlink.commands.view_second_run", f"{root}-b"
    with address.start_server(token, *second_run) as link:
        import hapticlink as hl
        from hapticlink.api.runs import with_board
        from hapticlink.orchestrator.scene.blocks import driver_of
        from hapticlink.orchestrator.scene.overrides import write_options
        from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene

        options = (*changes.options, *write_options(with_board(device)))
        read = load_viewed_scene(scene, options)  # while the server starts
        if driver_of(read, ""):
            from hapticlink.api.board_start import start_at_handle  # slow to load

            read = start_at_handle(read, wait_for_enter)
        address.show_served(read.title, link, token)
        hand = "whoever holds the board is" if driver_of(read, "") else "the mouse is"
        say(f"  {hand} the hand, in place of the scene's; Ctrl-C ends it")
        from hapticlink.visualization.live_and_standalone.offered_controls import SPEED
        from hapticlink.visualization.live_page.session import LiveSession

        settings = {SPEED: speed} if speed != 1.0 else None
        session = LiveSession(read, link, root, partial(hl.RealTime, speed=speed), settings)
        with suppress(Interrupted, hl.RunInterrupted):
            session.run()
    for folder in session.recordings:
        say(f"  {folder}/")
    return 0


def _write_page(name: str, changes: SceneOptions, path: Path) -> int:
    """Write the page of a scene that needs no server."""
    from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
    from hapticlink.visualization.standalone import page

    scene = load_viewed_scene(name, changes.options)
    if path.suffix.lower() != ".html":
        raise InputFault(f"--standalone {path}: name a file that ends in .html")
    title = default_folder("", name).name
    with waiting(f"{title}: compiling its page"):
        page.write_page(scene, title, path)
    say(f"{path}: {path.stat().st_size / 1e3:.0f} kB; open it in a browser and drag")
    return 0


def _replay(folders: list[str], address: PageAddress, export: Path | None) -> int:
    """Replay recorded runs on a page until Ctrl-C, or write them to a file."""
    from hapticlink.visualization.replay import replay_page, serve
    from hapticlink.visualization.replay.recorded_frames import Recorded

    if export:
        replay_page.require_written(export)
    runs = [Recorded(folder) for folder in folders]
    if export:
        replay_page.write_replay(runs, export)
        say(f"{export}: {export.stat().st_size / 1e3:.0f} kB")
        return 0
    html, token = replay_page.html(runs), secrets.token_urlsafe(16)
    with ExitStack() as pages, suppress(Interrupted):
        try:
            at = pages.enter_context(serve.serve_page(html, address.host, address.ports, token))
        except OSError as error:
            raise address.refused(error) from None
        address.show(" beside ".join(folders), at, token)
        say("  a replay, with a time slider; Ctrl-C ends it")
        while True:
            interrupt.raise_if_interrupted()
            time.sleep(WAIT)
    return 0


def _is_scene(name: str) -> bool:
    """Whether a folder's name is that of a shipped scene, and the folder has no run."""
    import hapticlink as hl

    return name in hl.shipped() and not (Path(name) / "run.json").exists()
