"""States of runs, damaged, of other versions, and given to other scenes, each gone on from by the
command: what is no longer what was saved is refused, and the results before it stay. Contents that
somebody gave a checksum that fits are not attacked."""

from __future__ import annotations

import hashlib
import json
import random
from collections.abc import Iterator
from pathlib import Path

import hapticlink as hl
from fuzz import mutations
from fuzz.cases import Made, seeded
from fuzz.commands import Place
from fuzz.processes import own_folder

SAVED = {
    "pendulum": {"duration": 0.1},
    "sampled-spring": {"duration": 0.1},
    "closed-loop-ideal": {"duration": 0.1, "hold": "foh"},
    "closed-loop-direct": {"duration": 0.1, "hold": "passive"},
}
KINDS = ("truncated", "bytes", "version", "scene", "scene")
OPTIONS = (
    *("duration=0.05", "duration=1e9", "haptics.rate=100", "graphics.rate=10", "hold=second"),
    *("start_time=1.0", "coupling=jacobi", "at=[{time=0.01, freeze=['hand.F']}]", "hold=pspm"),
    *("sensing=encoders", "controller.topology=false", "linkage.start.shoulder1=0.1"),
    *("packaging=native", "isolate=true", "record.every=7", "resume=''", "mechanism.substeps=3"),
)
"""Some of which a state fits, and some not."""


def changed(kind: str, content: bytes, draw: random.Random) -> bytes:
    if kind == "truncated":
        return content[: draw.choice((draw.randrange(len(content)), draw.randrange(200)))]
    if kind == "bytes":
        return mutations.flipped(content, draw)
    if kind == "scene":
        return content
    first, _, body = content.decode().split("\n", 2)
    rows = dict(json.loads(body)["table"])
    rows |= {"version": "0.0.1", "layout": draw.choice(("", "0" * 64, 3, None))}
    body = json.dumps({"table": [*rows.items()]})
    return f"{first}\n{hashlib.sha256(body.encode()).hexdigest()}\n{body}".encode()


def attack(number: int, seed: int) -> Iterator[Made]:
    with own_folder() as folder:
        whole = {}
        for name, options in SAVED.items():
            hl.run(name, options, out=folder / name, figures=False, save=[0.05])
            whole[name] = (folder / name / "at-0.05.state").read_bytes()
        place, path = Place(folder), folder / "attack.state"
        for i, case, draw in seeded(number, seed):
            kind, name = KINDS[i % len(KINDS)], draw.choice([*SAVED])
            yield Made(kind, f"{name}, {case}", *_made(kind, whole[name], draw, place, path))


def _made(
    kind: str, content: bytes, draw: random.Random, place: Place, path: Path
) -> tuple[str, str]:
    given = changed(kind, content, draw)
    path.write_bytes(given)
    command = ["run", *([draw.choice([*SAVED])] if kind == "scene" else [])]
    if kind == "scene":
        command += [f"--set={each}" for each in draw.sample(OPTIONS, draw.randrange(3))]
    outcome, wrong = place.made([*command, "--from", str(path), "--out", str(place.out)])
    if path.read_bytes() != given:
        return "lost", "the state has changed"
    if outcome == "done" and given != content:
        return "believed", "taken for a state"
    return outcome, wrong
