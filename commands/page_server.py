"""The server of a page that a command shows, and the options that say where."""

from __future__ import annotations

import os
import sys
import webbrowser
from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter, validators

from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base.errors import Fault, InputFault
from hapticlink.orchestrator.base.terminal_output import say

if TYPE_CHECKING:
    from hapticlink.visualization.live_page.server_pipe import ChildProcess

PORT = 8512
"""Of a page, where no other is asked for."""
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Variables of the environment that a screen sets, where it is neither Windows nor macOS."""
Host = Annotated[
    str,
    Parameter(help="Address to serve on; another one admits whoever knows the URL."),
]
Port = Annotated[
    int | None,
    Parameter(
        help="Port to serve on; by default 8512, or a free one if taken.",
        validator=validators.Number(gte=0, lte=65535),
    ),
]
Browser = Annotated[bool, Parameter(help="Open the page in the browser.")]


def start_server(host: str, port: int | None, *arguments: str) -> ChildProcess:
    """The page's server, which begins to start."""
    if not find_spec("websockets"):
        raise InputFault(f"the page needs the package websockets: {install_command('view')}")
    from hapticlink.visualization.live_page.server_pipe import ChildProcess

    return ChildProcess("hapticlink.visualization.live_page.server", host, ports(port), *arguments)


def port_of(link: ChildProcess, host: str, port: int | None) -> int:
    """The port that the server listens on. Raises InputFault where it cannot."""
    if (first := link.first()) is None:
        raise Fault("the page's server does not start")
    if "error" in first:
        raise InputFault(say_refused(host, port, first["error"]))
    return int(first["port"])


def ports(port: int | None) -> tuple[int, ...]:
    """Those of which the first free one is taken; 0 is any."""
    return (PORT, 0) if port is None else (port,)


def show(title: str, host: str, port: int, token: str, browser: bool) -> None:
    """Say the page's address, and open it in a browser that would open a window of its own, and not
    take over the terminal."""
    url = f"http://{f'[{host}]' if ':' in host else host}:{port}/{token}/"
    say(f"{title}: {url}")
    sys.stdout.flush()
    screen = sys.platform in ("win32", "darwin") or any(map(os.environ.get, SCREENS))
    if browser and screen:
        webbrowser.open(url)


def say_refused(host: str, port: int | None, why: object) -> str:
    """That the address cannot be served on."""
    asked = f"--host {host}" if port is None else f"--host {host} --port {port}"
    return f"{asked}: {why}: choose another"
