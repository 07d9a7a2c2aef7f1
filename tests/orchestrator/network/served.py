"""Servers and bad networks of tests, as processes of their own."""

import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import sleep

from tests.orchestrator.foreign_scenes import COMMAND

ROOT = Path(__file__).parents[3]


def free_address() -> str:
    """A loopback address that nobody listens at."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{probe.getsockname()[1]}"


def command(*arguments: object) -> list[str]:
    """A command of hapticlink."""
    return [*COMMAND, *map(str, arguments)]


@contextmanager
def process(arguments: Sequence[str], log: Path, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A process that writes to a file, and is ended with the context."""
    with log.open("wb") as file:
        running = subprocess.Popen(arguments, stdout=file, stderr=file, cwd=folder)
        try:
            yield running
        finally:
            running.terminate()
            assert running.wait(60) is not None


@contextmanager
def server(
    scene: object, folder: Path, *options: object, at: str = "", before: Sequence[str] = ()
) -> Iterator[str]:
    """The address of a server of a scene, with the key folder/key; `before` comes before its
    command."""
    at, log = at or free_address(), folder / "serve.log"
    arguments = ("serve", scene, "--listen", at, "--key", folder / "key", *options)
    with process([*before, *command(*arguments)], log, folder) as running:
        until(lambda: "serves at" in log.read_text(), running, log)
        yield at


@contextmanager
def relay(folder: Path, to: str, *numbers: float) -> Iterator[str]:
    """The address of a relay with the numbers of `benchmarks/network_relay.py`."""
    at = free_address()
    arguments = [at, to, str(folder / "key"), *map(str, numbers)]
    module = [sys.executable, "-m", "benchmarks.network_relay"]
    with process([*module, *arguments], folder / "relay.log", ROOT):
        yield at


def processes_of(folder: Path) -> list[int]:
    """The processes whose command names a folder (Linux)."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            if str(folder) in (entry / "cmdline").read_text() and int(entry.name) != os.getpid():
                found.append(int(entry.name))
        except OSError:  # it has ended
            pass
    return found


def until(come: Callable[[], object], running: subprocess.Popen[bytes], log: Path) -> None:
    """Waits for a process that writes to `log`."""
    while not come():
        assert running.poll() is None, log.read_text()
        sleep(0.05)
