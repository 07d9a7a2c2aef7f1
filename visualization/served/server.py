"""Serves the page on localhost, in a process of its own: files, and a websocket to each window.

Pickled messages come from the haptic loop by the standard input, whose end ends the process: first
host, port (0: a free one) and token, as text, which no other process can read there. Those of the
pages leave by the standard output.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import pickle
import signal
import sys
import threading
from http import HTTPStatus
from pathlib import Path
from typing import IO, Any

from websockets.asyncio.server import Server, ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from hapticlink.visualization.interactive import scene_message
from hapticlink.visualization.mechanism.picture import Picture
from hapticlink.visualization.page.one_file import PAGE
from hapticlink.visualization.served import messages
from hapticlink.visualization.served.server_pipe import read
from hapticlink.visualization.served.stability_process import StabilityProcess

TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}
WINDOWS = 16
"""Windows that are served at a time."""
BEHIND = 1 << 18
"""Bytes that may wait for a window; while more do, it gets no frames."""
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; connect-src 'self'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


class Pages:
    """All windows: each sees the same run; one at a time has hold of a user's handle."""

    def __init__(self, token: str, out: IO[bytes]) -> None:
        self._token, self._out = token, out
        self._windows: set[ServerConnection] = set()
        self._holding: dict[str, ServerConnection | None] = {"": None}
        self._picture: Picture | None = None
        self._kept: dict[str, str] = {}
        self._map = StabilityProcess(self.show)
        self._files = {p.name: p for p in PAGE.iterdir() if p.suffix in TYPES}

    # --- from the haptic loop -----------------------------------------------------------------

    def show(self, message: dict[str, Any]) -> None:
        """Send a message of the loop to all windows."""
        kind = message["type"]
        if kind == "map" and "asked" in message:
            self._map.ask(message["asked"])
            return
        if kind == "scene":
            self._picture = Picture(*message.pop("picture"))
            message |= scene_message.drawn(self._picture)
            self._holding = {user: self._holding.get(user) for user in message["users"]}
        elif kind == "frame" and self._picture:
            message = self._picture.drawn(message)
        text = json.dumps(message)
        if kind != "refused":
            self._kept[kind] = text
        ready = [w for w in self._windows if w.transport.get_write_buffer_size() < BEHIND]
        broadcast(ready if kind == "frame" else self._windows, text)

    async def end(self) -> None:
        """End what is being computed."""
        await self._map.end()

    # --- from the windows ---------------------------------------------------------------------

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """A file below the token's path, None for the websocket there; 404 for all else."""
        _, _, rest = request.path.partition(f"/{self._token}/")
        if not request.path.startswith(f"/{self._token}/"):
            return _response(HTTPStatus.NOT_FOUND)
        if rest == "run":
            origin = request.headers.get("Origin")
            if origin != f"http://{request.headers.get('Host')}":
                return _response(HTTPStatus.FORBIDDEN)
            full = len(self._windows) >= WINDOWS
            return _response(HTTPStatus.SERVICE_UNAVAILABLE) if full else None
        file = self._files.get(rest or "index.html")
        return _response(HTTPStatus.OK, file) if file else _response(HTTPStatus.NOT_FOUND)

    async def window(self, connection: ServerConnection) -> None:
        """Serve a window until it is closed."""
        for kind in ("building", "scene", "controls", "state", "map"):
            if kind in self._kept:
                await connection.send(self._kept[kind])
        self._windows.add(connection)
        try:
            async for text in connection:
                try:
                    self._take(connection, messages.parse(text))
                except ValueError as error:
                    await connection.send(json.dumps({"type": "refused", "why": str(error)}))
        except ConnectionClosed:
            pass  # without a farewell, as where the browser was ended
        finally:
            self._windows.discard(connection)
            for user in [u for u, holder in self._holding.items() if holder is connection]:
                self._holding[user] = None
                self._tell(messages.Hand("hand", None, user))

    def _take(self, connection: ServerConnection, message: messages.Message) -> None:
        if isinstance(message, messages.Hand):
            if message.user not in self._holding:
                raise ValueError(f"user: there is no {message.user!r}")
            if self._holding[message.user] not in (None, connection):
                raise ValueError("another window has hold of this handle")
            self._holding[message.user] = connection if message.at else None
        self._tell(message)

    def _tell(self, message: messages.Message) -> None:
        pickle.dump(message, self._out)
        self._out.flush()


def _response(status: HTTPStatus, file: Path | None = None) -> Response:
    body = file.read_bytes() if file else f"{status.phrase}\n".encode()
    kind = TYPES[file.suffix] if file else "text/plain"
    content = {"Content-Type": f"{kind}; charset=utf-8", "Content-Length": str(len(body))}
    headers = Headers({**HEADERS, **content, "Connection": "close"})
    return Response(status.value, status.phrase, headers, body)


async def _bound(pages: Pages, host: str, port: int) -> Server:
    return await serve(
        pages.window, host, port, process_request=pages.answer, max_size=messages.MAX_CHARACTERS,
        compression=None, server_header=None, open_timeout=5, close_timeout=1,
    )  # fmt: skip


async def _served(host: str, port: int, token: str, out: IO[bytes]) -> None:
    pages = Pages(token, out)
    try:
        server = await _bound(pages, host, port)
    except OSError as error:
        pickle.dump({"error": error.strerror or str(error)}, out)
        out.flush()
        return
    pickle.dump({"port": server.sockets[0].getsockname()[1]}, out)
    out.flush()
    loop, ended = asyncio.get_running_loop(), asyncio.Event()

    def failed(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        loop.default_exception_handler(context)
        ended.set()

    loop.set_exception_handler(failed)

    def receive() -> None:
        while (message := read(sys.stdin.buffer)) is not None:
            loop.call_soon_threadsafe(pages.show, message)
        loop.call_soon_threadsafe(ended.set)

    threading.Thread(target=receive, daemon=True).start()
    async with server:
        await ended.wait()
        await pages.end()


def main() -> None:
    """Serve until the standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever prints must not get between the messages
    logging.getLogger("websockets").setLevel(logging.CRITICAL)  # connections that fail are no news
    if (arguments := read(sys.stdin.buffer)) is None:
        return
    host, port, token = arguments
    try:
        asyncio.run(_served(host, int(port), token, out))
    except BrokenPipeError:  # nobody is left to be told
        os._exit(1)


if __name__ == "__main__":
    main()
