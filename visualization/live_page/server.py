"""Serves the page on localhost, in a process of its own: files, and a websocket to each window.

The haptic loop sends pickled messages to the standard input, whose end ends the process; messages
of the pages leave by the standard output. The first message has host, ports of which the first free
one is taken (0: any), token, and the module and result folder of a second run: as other processes
could read them among the arguments of the command, they come this way.

What draws is loaded with the message that begins, by the thread that reads: so the page is served
at once.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import sys
import threading
from collections.abc import Sequence
from http import HTTPStatus
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from websockets.asyncio.server import Server, ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from hapticlink.visualization.browser_code.one_file import PAGE, headers
from hapticlink.visualization.live_and_standalone.choose_model import MODEL
from hapticlink.visualization.live_and_standalone.offered_controls import SPEED
from hapticlink.visualization.live_page import messages
from hapticlink.visualization.live_page.server_pipe import (
    ChildProcess,
    read_message,
    to_caller,
    write_message,
)
from hapticlink.visualization.live_page.stability_process import StabilityProcess

if TYPE_CHECKING:
    from hapticlink.visualization.mechanism.picture import Picture

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
POLICY = "default-src 'self'; connect-src 'self'"


class Pages:
    """All windows: each sees the same run, or the same two; one at a time has hold of a user's
    handle. second_run: the module of the second run's process, and where that one records."""

    def __init__(self, token: str, second_run: Sequence[str], out: IO[bytes]) -> None:
        self._token, self._second_run, self._out = token, second_run, out
        self._windows: set[ServerConnection] = set()
        self._holding: dict[str, ServerConnection | None] = {"": None}
        self._picture: Picture | None = None
        self._newest: dict[str, dict[str, Any]] = {}
        self._second: ChildProcess | None = None
        self._newest_of_second: dict[str, dict[str, Any]] = {}
        self._begins_first = False  # a run that the second one has to begin with
        self._stability = StabilityProcess(self.show)
        self._files = {p.name: p for p in PAGE.iterdir() if p.suffix in TYPES}

    # --- from the runs ------------------------------------------------------------------------

    def show(self, message: dict[str, Any]) -> None:
        """Send a message of the first run to all windows."""
        kind = message["type"]
        if kind == "settings":
            self._newest[kind] = message
            settings = {k: v for k, v in message["settings"].items() if k != SPEED}
            self._stability.ask(message["scene"], settings, message["parameters"])
            return
        if kind == "opening":
            self._picture = message.pop("picture")
        elif kind == "scene":
            runs = 2 if self._second else 1
            if self._second and self._begins_first:
                self._second.send(messages.Time("time", "reset"))
            self._begins_first = False
            message = self._newest["opening"] | message | {"runs": runs}
            self._holding = {user: self._holding.get(user) for user in message["users"]}
        elif kind == "frame" and self._picture:
            self._take_second(self._picture)
            message = self._picture.drawn(message)
        if kind != "refused":
            self._newest[kind] = message
        self._broadcast(kind, message)

    def _broadcast(self, kind: str, message: dict[str, Any]) -> None:
        ready = [w for w in self._windows if w.transport.get_write_buffer_size() < BEHIND]
        broadcast(ready if kind == "frame" else self._windows, self._text(kind, message))

    def _text(self, kind: str, message: dict[str, Any]) -> str:
        """A message as windows get it: what changes in a run with that of the second one."""
        second = self._newest_of_second.get(kind) if kind in ("controls", "frame") else None
        return json.dumps(message | {"b": second} if second else message)

    def _take_second(self, picture: Picture) -> None:
        """Take what the second run has sent; both begin anew when it is there."""
        messages_of_second = self._second.received() if self._second else []
        for message in messages_of_second:
            kind = message["type"]
            if kind == "scene" and kind not in self._newest_of_second:
                if not self._newest["state"]["paused"] and self._second:
                    self._second.send(messages.Time("time", "resume"))
                self._tell(messages.Time("time", "reset"))
            self._newest_of_second[kind] = picture.drawn(message) if kind == "frame" else message
            if kind == "controls":
                self._broadcast(kind, self._newest[kind])
            elif kind == "refused" or (kind == "state" and message["ended"]):
                self._broadcast(kind, message | {"b": True})
        if self._second and not self._second.alive:
            self._compare(False)
            self._broadcast("refused", {"type": "refused", "why": "the second run has ended"})

    def _compare(self, on: bool) -> None:
        """Begin a second run with the settings of the first, or end it."""
        if on and not self._second and (first := self._newest.get("settings")):
            module, root = self._second_run
            self._second = ChildProcess(module, root, first["given"], first["settings"])
            self._broadcast("refused", {"type": "refused", "why": "the second run begins"})
        elif not on and self._second:
            asyncio.get_running_loop().run_in_executor(None, self._second.end)
            self._second, self._newest_of_second = None, {}
            self._tell(messages.Time("time", "reset"))

    def end(self) -> None:
        """End the processes below this one."""
        self._stability.end()
        if self._second:
            self._second.end()

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
        for kind in ("opening", "building", "scene", "controls", "state", "map", "question"):
            if message := self._newest.get(kind):
                await connection.send(self._text(kind, message))
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
        if isinstance(message, messages.Compare):
            self._compare(message.on)
        else:
            self._tell(message)

    def _tell(self, message: messages.Message) -> None:
        """Tell the run that a change is of, or both of a hand, a button and the speed."""
        control = message if isinstance(message, messages.SetControl) else None
        of_one = control is not None and control.key != SPEED
        of_second = of_one and control and control.b and self._second
        if not of_second:
            write_message(self._out, message)
        if self._second and (of_second or not of_one):
            self._second.send(message)
        if control and control.key == MODEL:
            if of_second:
                self._newest_of_second.pop("scene", None)  # both begin anew with the next one
            else:
                self._begins_first = True


def _response(status: HTTPStatus, file: Path | None = None) -> Response:
    body = file.read_bytes() if file else f"{status.phrase}\n".encode()
    kind = TYPES[file.suffix] if file else "text/plain"
    content = {"Content-Type": f"{kind}; charset=utf-8", "Content-Length": str(len(body))}
    sent = Headers({**headers(POLICY), **content, "Connection": "close"})
    return Response(status.value, status.phrase, sent, body)


async def _bound(pages: Pages, host: str, ports: Sequence[int]) -> Server:
    """The server on the first port that is free. Raises OSError of the last one."""
    port, *others = ports
    try:
        return await serve(
            pages.window, host, port, process_request=pages.answer, compression=None,
            max_size=messages.MAX_CHARACTERS, server_header=None, open_timeout=5, close_timeout=1,
        )  # fmt: skip
    except OSError:
        if not others:
            raise
        return await _bound(pages, host, others)


async def _served(
    host: str, ports: Sequence[int], token: str, second_run: Sequence[str], out: IO[bytes]
) -> None:
    pages = Pages(token, second_run, out)
    try:
        server = await _bound(pages, host, ports)
    except OSError as error:
        return write_message(out, {"error": error.strerror or str(error)})
    write_message(out, {"port": server.sockets[0].getsockname()[1]})
    loop, ended = asyncio.get_running_loop(), asyncio.Event()

    def failed(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        loop.default_exception_handler(context)
        ended.set()

    loop.set_exception_handler(failed)

    def receive() -> None:
        try:
            while (message := read_message(sys.stdin.buffer)) is not None:
                if message["type"] == "opening":
                    from hapticlink.visualization.live_and_standalone import first_messages

                    message = first_messages.open_page(message["title"], *message["picture"])
                loop.call_soon_threadsafe(pages.show, message)
        finally:
            loop.call_soon_threadsafe(ended.set)

    threading.Thread(target=receive, daemon=True).start()
    async with server:
        await ended.wait()
        pages.end()


def main() -> None:
    """Serve until the standard input ends."""
    out = to_caller()
    # Connections that fail, or are gone while something is written, are no news.
    for name, level in (("websockets", logging.CRITICAL), ("asyncio", logging.ERROR)):
        logging.getLogger(name).setLevel(level)
    if (arguments := read_message(sys.stdin.buffer)) is None:
        return
    host, ports, token, *second_run = arguments
    try:
        asyncio.run(_served(host, ports, token, second_run, out))
    except BrokenPipeError:  # nobody is left to be told
        os._exit(1)


if __name__ == "__main__":
    main()
