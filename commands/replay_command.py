"""`hapticlink view` of recorded runs."""

from __future__ import annotations

import secrets
import time
from contextlib import ExitStack, suppress
from pathlib import Path

from hapticlink.commands import page_address
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import InputFault, Interrupted
from hapticlink.orchestrator.base.terminal_output import say
from hapticlink.visualization.replay import replay_page, serve
from hapticlink.visualization.replay.recorded_frames import Recorded

WAIT = 0.1
"""Time (s) between two looks for Ctrl-C."""


def replay(
    folders: list[str], host: str, port: int | None, browser: bool, export: Path | None
) -> int:
    """Replay recorded runs on a page until Ctrl-C, or write them to a file."""
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
            served_port = open_pages.enter_context(
                serve.served(html, host, page_address.PORT if port is None else port, token)
            )
        except OSError as error:
            if port is not None:
                raise InputFault(page_address.refused(host, port, error)) from None
            served_port = open_pages.enter_context(serve.served(html, host, 0, token))
        page_address.show(" beside ".join(folders), host, served_port, token, browser)
        say("  a replay, with a time slider; Ctrl-C ends it")
        while True:
            interrupt.check()
            time.sleep(WAIT)
    return 0
