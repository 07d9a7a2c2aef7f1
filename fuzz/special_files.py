"""Folders of runs in which something is no regular file, has no end, or nests without end; every
command that reads such a folder, or writes a run to it."""

from __future__ import annotations

import json
import os
import socket
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

from fuzz.cases import Made, seeded
from fuzz.commands import Place
from fuzz.processes import own_folder

NAMES = ("run.json", "haptics.csv", "plan.txt", "haptics.rows", "new")
COMMANDS = ("run", "report", "compare", "recover", "export", "sweep")


def _socket(path: Path) -> None:
    here = os.getcwd()
    os.chdir(path.parent)  # its address has 108 characters at most
    try:
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(path.name)
    finally:
        os.chdir(here)


def _listing(path: Path) -> None:
    story = path.parent / "run.json"
    if story.is_file():
        content = json.loads(story.read_text())
        content["files"] += [path.name, "..", "/etc/passwd", "a\0b", 7, None, "x" * 300]
        story.write_text(json.dumps(content))
    path.mkdir(exist_ok=True)


def _rows(path: Path, content: bytes) -> None:
    """As of a run that was killed, whatever was to be spoiled."""
    for suffix in (".csv", ".rows"):
        path.with_name(f"haptics{suffix}").unlink(missing_ok=True)
    path.with_name("haptics.rows").write_bytes(content)


HEADER = b"time,a.y\n".ljust(16, b"\n") + (3).to_bytes(8, "little")
NAN, DISORDER = [0.0, 1.0, float("nan"), 1.0, 2.0, 1.0], [0.0, 1.0, 2.0, 1.0, 1.0, 1.0]
KINDS: dict[str, Callable[[Path], object]] = {
    "a pipe": os.mkfifo,
    "a folder": Path.mkdir,
    "a folder that is listed": _listing,
    "a link to /dev/zero": lambda path: path.symlink_to("/dev/zero"),
    "a link to /dev/full": lambda path: path.symlink_to("/dev/full"),
    "a link to /dev/null": lambda path: path.symlink_to("/dev/null"),
    "a link to itself": lambda path: path.symlink_to(path.name),
    "a socket": _socket,
    "brackets": lambda path: path.write_text("[" * 100_000),
    "one line": lambda path: path.write_text("x" * 2_000_000),
    "rows of nothing": lambda path: _rows(path, b""),
    "rows without a header": lambda path: _rows(path, bytes(100)),
    "rows that are cut": lambda path: _rows(path, HEADER + bytes(20)),
    "rows without a time": lambda path: _rows(path, HEADER + struct.pack("<6d", *NAN)),
    "rows in disorder": lambda path: _rows(path, HEADER + struct.pack("<6d", *DISORDER)),
    "no text": lambda path: path.write_bytes(bytes(range(256)) * 40),
}


def _arguments(name: str, out: Path, elsewhere: Path) -> list[str]:
    if name == "run":
        return ["run", "pendulum", "--set", "duration=0.1", "--no-figures", "--out", str(out)]
    if name == "sweep":
        values = ["--vary", "duration=0.01,0.02", "--jobs", "1"]
        return ["sweep", "pendulum", *values, "--out", str(out)]
    if name == "export":
        return ["view", str(out), "--export", str(elsewhere / "replay.html")]
    if name == "report":
        return ["report", str(out), "--out", str(elsewhere / "report.html")]
    return [name, str(out), *([str(out)] if name == "compare" else [])]


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` folders, the kinds in turn."""
    with own_folder() as folder:
        place, elsewhere = Place(folder), folder / "elsewhere"
        elsewhere.mkdir()
        for i, _, draw in seeded(number, seed):
            kind = [*KINDS][i % len(KINDS)]
            place.renew()
            spoiled = place.out / draw.choice(NAMES)
            if kind != "a folder that is listed" or spoiled.name != "run.json":
                spoiled.unlink(missing_ok=True)
                KINDS[kind](spoiled)
            name = draw.choice(COMMANDS)
            status, said = place.forked(_arguments(name, place.out, elsewhere))
            yield Made(kind, f"{name}, {spoiled.name}", *_judged(place, status, said))


def _judged(place: Place, status: int | None, said: str) -> tuple[str, str]:
    if bad := place.broken(status, said):
        return bad
    if "╭" in said:
        return "crashed", f"the attack's own command: {said[-300:]}"
    if left := place.left_files():
        return "lost", f"temporary {', '.join(left)}: {said[-300:]}"
    return ("done", "told", "refused")[status or 0], ""
