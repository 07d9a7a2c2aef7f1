"""Caches of built FMUs that others can write to, that are none, or that hold what nobody put there:
a run goes on without them, its tables are those of any other run, and what others have put into a
cache is never run."""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Iterator
from pathlib import Path

from fuzz import mutations
from fuzz.cases import Made, seeded
from fuzz.commands import Place
from fuzz.processes import own_folder

RUN = ["run", "pendulum", "--set", "duration=0.05", "--no-figures"]


def _filled(cache: Path) -> list[Path]:
    return [path for path in cache.rglob("*") if path.is_file()]


def _damage(cache: Path, draw: random.Random) -> None:
    for path in _filled(cache):
        if draw.random() < 0.5:
            path.write_bytes(mutations.flipped(path.read_bytes() or b"0", draw))


def _replace_by_folders(cache: Path, draw: random.Random) -> None:
    for path in draw.sample(_filled(cache), k=min(2, len(_filled(cache)))):
        path.unlink()
        path.mkdir()


def _replace_by_pipes(cache: Path, draw: random.Random) -> None:
    for path in draw.sample(_filled(cache), k=min(2, len(_filled(cache)))):
        path.unlink()
        os.mkfifo(path)


def _lose(cache: Path, draw: random.Random) -> None:
    for path in _filled(cache):
        if draw.random() < 0.5:
            path.unlink()


def _give(cache: Path, draw: random.Random) -> None:
    """To another user, where this one may."""
    if os.geteuid() == 0:
        for path in (cache, *_filled(cache)):
            if path == cache or draw.random() < 0.5:
                os.chown(path, 12345, 12345)


def _become_file(cache: Path, draw: random.Random) -> None:
    cache.rename(cache.with_name("away"))
    cache.write_bytes(b"" if draw.random() < 0.5 else b"a file")


def _become_link(cache: Path, draw: random.Random) -> None:
    cache.rename(cache.with_name("away"))
    cache.symlink_to(draw.choice(("nowhere", cache.name, "/dev/full", "/proc")))


KINDS: dict[str, Callable[[Path, random.Random], object]] = {
    "open to all": lambda cache, draw: cache.chmod(draw.choice((0o777, 0o1777, 0o702))),
    "another user's": _give,
    "a file": _become_file,
    "a link": _become_link,
    "damaged": _damage,
    "folders for files": _replace_by_folders,
    "pipes for files": _replace_by_pipes,
    "lost files": _lose,
}


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` caches, the kinds in turn; in whole processes, which remove what they have at
    their end."""
    with own_folder() as folder:
        place = Place(folder)
        for i, case, draw in seeded(number, seed):
            kind = [*KINDS][i % len(KINDS)]
            yield Made(kind, case, *_made(place, folder / f"cache{i}" / "cache", KINDS[kind], draw))


def _made(
    place: Place, cache: Path, spoil: Callable[[Path, random.Random], object], draw: random.Random
) -> tuple[str, str]:
    tables = []
    for first in (True, False):
        run = place.started([*RUN, "--out", str(place.out)], HAPTICLINK_CACHE=str(cache))
        status, said = run.ended()
        if bad := place.broken(status, said):
            return bad
        if status or (wrong := "; ".join(place.left())):
            return "lost", f"status {status}: {wrong if not status else said[-300:]}"
        tables.append((place.out / "haptics.csv").read_bytes())
        if first:
            spoil(cache, draw)
    return ("done", "") if tables[0] == tables[1] else ("lost", "its rows are others")
