"""The address of a page that a command serves: its port, and the browser that opens it."""

from __future__ import annotations

import os
import sys
import webbrowser

from hapticlink.orchestrator.base.terminal_output import say

PORT = 8512
"""Where no other is asked for."""


def show(title: str, host: str, port: int, token: str, browser: bool) -> None:
    """Say the page's address, and open it in a browser where there is a screen."""
    url = f"http://{f'[{host}]' if ':' in host else host}:{port}/{token}/"
    say(f"{title}: {url}")
    sys.stdout.flush()
    if browser and _has_screen():
        webbrowser.open(url)


def refused(host: str, port: int | None, why: object) -> str:
    """That the address cannot be served on."""
    asked = f"--host {host}" if port is None else f"--host {host} --port {port}"
    return f"{asked}: {why}: choose another"


def _has_screen() -> bool:
    """Whether a browser would open a window of its own, and not take over the terminal."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
