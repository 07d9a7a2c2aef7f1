"""A page that is served by the command, and windows on it."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets import Origin
from websockets.sync.client import ClientConnection, connect

SCENE = """
extends = "parallelogram"
title = "Parallelogram at a device"
hold = "zoh"
graphics.rate = 30
device.base = [0.275, 0.0]
controller.bias = "full"
"""
"""One closed-loop mechanism with one free direction, at right angles to its rockers."""
FREE, CONSTRAINED = (-0.4794, 0.8776), (0.8776, 0.4794)
"""Of its operational point at the start: the rockers stand at 0.5 rad."""


Condition = Callable[[dict[str, Any]], object]


class Served:
    """`hapticlink view` of a scene, by default of the text SCENE, in a folder."""

    def __init__(
        self, folder: Path, *arguments: str, scene: str = "scene.toml", text: str = SCENE
    ) -> None:
        (folder / "scene.toml").write_text(text)
        command = [sys.executable, "-m", "hapticlink", "view", scene]
        self.process = subprocess.Popen(
            [*command, "--no-browser", "--port", "0", "--out", "made", *arguments],
            cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )  # fmt: skip
        assert self.process.stdout
        line = self.process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:(\d+)(/.+/)$", line.strip())
        assert found, line + self.process.stdout.read()
        self.folder, self.port, self.path = folder, int(found[1]), found[2]
        self.url = f"http://127.0.0.1:{self.port}{self.path}"

    def __enter__(self) -> Served:
        return self

    def __exit__(self, *error: object) -> None:
        self.process.kill()
        self.process.communicate()

    @contextmanager
    def window(self, origin: str | None = None) -> Iterator[Window]:
        """A websocket like that of a page."""
        own = f"http://127.0.0.1:{self.port}"
        with connect(
            f"ws{self.url[4:]}run",
            origin=Origin(origin or own),
            proxy=None,
            max_queue=None,  # frames that no test reads
        ) as socket:
            yield Window(socket)

    def end(self) -> tuple[int, str]:
        """Ctrl-C; the exit status and what was printed after the address."""
        self.process.send_signal(signal.SIGINT)
        said, _ = self.process.communicate(timeout=30)
        return self.process.returncode, said


class Window:
    """One window: the newest message of each type."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket, self.newest = socket, dict[str, Any]()

    def send(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def set(self, key: str, value: Any, **of: Any) -> None:
        """Give a control a value."""
        self.send(type="set", key=key, value=value, **of)

    def until(self, holds: Condition, seconds: float = 120) -> dict[str, Any]:
        """The newest messages by type, once they are as asked for."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            message = json.loads(self.socket.recv(timeout=seconds))
            self.newest[message["type"]] = message
            if "frame" in self.newest and holds(self.newest):
                return dict(self.newest)
        raise AssertionError(f"not within {seconds} s: {self.newest}")


def values(controls: dict[str, Any]) -> dict[str, Any]:
    """The values in a message of controls, by key."""
    return {each["key"]: each["value"] for each in controls.get("controls", ())}
