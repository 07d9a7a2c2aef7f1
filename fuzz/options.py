"""Options of the commands that are wrong: keys and values of --set, ranges of --vary, flags."""

from __future__ import annotations

import random
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fuzz import mutations
from fuzz.cases import Made
from fuzz.commands import Place
from fuzz.processes import own_folder
from fuzz.scenes import SMALL
from hapticlink.orchestrator.scene import find_scene

KINDS = ("set", "vary", "flags")
WORDS = (
    "run", "info", "build", "export", "sweep", "schema", "--set", "--vary", "--out", "--explain",
    "--plugin", "--jobs", "--runs", "--metric", "--scheduler", "--help", "--version", "--bogus",
    "--", "-", "", "=", "--set=", "--jobs=-1", "--jobs=1e9", "0", "two", "/dev/null", "/dev/full",
    "none.toml", "none.ssp", "none.csv", ".", "/", "\udcff", "closed-loop-ideal", "pendulum",
    "x" * 300,
)  # fmt: skip
NUMBERS = ("0", "1", "-1", "1e400", "1e-400", "0.5", "nan", "inf", "1e9", "9" * 5000, "", "x", "²")


def _keys(draw: random.Random) -> tuple[str, Any]:
    """A dotted key of a scene, and what stands there."""
    tables = tomllib.loads(find_scene.find_scene(draw.choice(SMALL))[1])
    path = draw.choice([*mutations.places(tables)])
    names = [str(name) for name in path]
    for _ in range(draw.choice((0, 0, 0, 1, 2))):
        i = draw.randrange(len(names))
        how = draw.randrange(4)
        if how == 0:
            names[i] = mutations.text(names[i], draw)
        elif how == 1:
            names[i] = draw.choice(mutations.TEXTS)
        elif how == 2:
            names.insert(i, draw.choice(mutations.TEXTS))
        else:
            names.pop(i)
            names = names or [""]
    return ".".join(names), mutations.at(tables, path)


def _value(old: Any, draw: random.Random) -> str:
    pool = (*mutations.NUMBERS, *mutations.TEXTS, *mutations.TABLES)
    near = mutations.near(old, draw)
    value = draw.choice((old, near, near, near, draw.choice(pool)))
    said = draw.choice((str(value), repr(value)))
    return mutations.text(said, draw) if draw.random() < 0.2 else said


def _range(old: Any, draw: random.Random) -> str:
    about = (str(mutations.near(old, draw)) for _ in range(3))
    a, b, c = about if draw.random() < 0.5 else (draw.choice(NUMBERS) for _ in range(3))
    return draw.choice((f"{a}..{b}", f"{a}..{b}..{c}", f"{a}..{b}:{c}", f"{a},{b},{c}", a))


def arguments(kind: str, out: Path, draw: random.Random) -> list[str]:
    """Of a command that writes to `out` at most."""
    scene = draw.choice(SMALL)
    short = ["--set", "duration=0.05", "--out", str(out)]
    if kind == "set":
        found = ["run", scene, *short]
        for _ in range(draw.choice((1, 1, 2))):
            key, old = _keys(draw)
            given = f"{key}={_value(old, draw)}"
            found += ["--set", given if draw.random() < 0.8 else key]
        return found
    if kind == "vary":
        key, old = _keys(draw)
        values = draw.choice((_range(old, draw), _value(old, draw)))
        values = mutations.text(values, draw) if draw.random() < 0.3 else values
        return ["sweep", scene, *short, "--jobs", "1", "--vary", f"{key}={values}"]
    found = [draw.choice(("run", "info", "export", "build", "sweep", "schema")), scene, *short]
    for _ in range(draw.choice((1, 2, 3))):
        found.insert(draw.randrange(len(found) + 1), draw.choice(WORDS))
    if draw.random() < 0.3:
        found.pop(draw.randrange(len(found)))
    return found


def attack(number: int, seed: int) -> Iterator[Made]:
    draw = random.Random(seed)
    with own_folder() as folder:
        place = Place(folder)
        for i in range(number):
            kind = KINDS[i % len(KINDS)]
            made = [a.replace("\0", "") for a in arguments(kind, place.out, draw)]
            yield Made(kind, ascii(made)[:500], *place.made(made))
