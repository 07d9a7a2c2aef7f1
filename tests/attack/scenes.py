"""Shipped scenes with values, keys, structure, lines or bytes changed, each run by the command."""

from __future__ import annotations

import random
import re
import tomllib
from collections.abc import Iterator
from typing import Any

from hapticlink.orchestrator.scene import find_scene, overrides
from tests.attack import mutations
from tests.attack.cases import Made
from tests.attack.commands import Place
from tests.attack.processes import own_folder

SMALL = ("pendulum", "single-body", "four-bar", "slider-crank", "sampled-spring", "trammel")
KINDS = ("values", "lines", "bytes")


def written(tables: dict[str, Any]) -> str:
    """Tables as TOML, one key of the outermost table a line."""
    entries = (overrides.text({key: value}, key) for key, value in tables.items())
    return "".join(f"{entry[1:-1]}\n" for entry in entries)


def cases(number: int, seed: int) -> Iterator[tuple[str, str, bytes]]:
    """Kind, what was changed, and the scene's file."""
    draw = random.Random(seed)
    scenes = {name: find_scene.find_scene(name)[1] for name in find_scene.shipped()}
    for i in range(number):
        kind = KINDS[i % 6] if i % 6 < len(KINDS) else "values"
        name = draw.choice([*SMALL, *SMALL, *scenes])
        text, said = scenes[name], name
        if kind == "values":
            tables: Any = tomllib.loads(text) | {"duration": 0.05}
            for _ in range(draw.choice((1, 1, 1, 2, 4))):
                tables, what = mutations.mutated(tables, draw)
                said += f", {what}"
            content = written(tables).encode(errors="surrogatepass")
        else:
            text = re.sub(r"(?m)^duration = .*", "duration = 0.05", text)
            for _ in range(draw.choice((1, 1, 2, 4))):
                text = mutations.lines(text, draw)
            content = text.encode()
            if kind == "bytes":
                content = mutations.flipped(content, draw)
        yield kind, said, content


def attack(number: int, seed: int) -> Iterator[Made]:
    with own_folder() as folder:
        place, path = Place(folder), folder / "scene.toml"
        for kind, said, content in cases(number, seed):
            path.write_bytes(content)
            yield Made(kind, said, *place.made(["run", str(path), "--out", str(place.out)]))
