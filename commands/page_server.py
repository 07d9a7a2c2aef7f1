"""The server of a page that a command shows, and the options that say where."""

from __future__ import annotations

import os
import sys
import webbrowser
from dataclasses import dataclass
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


@Parameter(name="*")
@dataclass(frozen=True)
class PageAddress:
    """Where a page is served, and whether a browser opens it."""

    host: Host = "127.0.0.1"
    port: Port = None
    browser: Browser = True

    @property
    def ports(self) -> tuple[int, ...]:
        """Those of which the first free one is taken; 0 is any."""
        return (PORT, 0) if self.port is None else (self.port,)

    def start_server(self, *arguments: str) -> ChildProcess:
        """The page's server, which begins to start."""
        if not find_spec("websockets"):
            raise InputFault(f"the page needs the package websockets: {install_command('view')}")
        from hapticlink.visualization.live_page.server_pipe import ChildProcess

        module = "hapticlink.visualization.live_page.server"
        return ChildProcess(module, self.host, self.ports, *arguments)

    def show_served(self, title: str, link: ChildProcess, token: str) -> None:
        """As `show`, once the server listens. Raises InputFault where it cannot."""
        if (first := link.first()) is None:
            raise Fault("the page's server does not start")
        if "error" in first:
            raise self.refused(first["error"])
        self.show(title, int(first["port"]), token)

    def show(self, title: str, port: int, token: str) -> None:
        """Say the page's address, and open it in a browser that would open a window of its own, and
        not take over the terminal."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        url = f"http://{host}:{port}/{token}/"
        say(f"{title}: {url}")
        sys.stdout.flush()
        screen = sys.platform in ("win32", "darwin") or any(map(os.environ.get, SCREENS))
        if self.browser and screen:
            webbrowser.open(url)

    def refused(self, why: object) -> InputFault:
        """The fault of an address that cannot be served on."""
        asked = f"--host {self.host}"
        asked += "" if self.port is None else f" --port {self.port}"
        return InputFault(f"{asked}: {why}: choose another")


LOCAL = PageAddress()
