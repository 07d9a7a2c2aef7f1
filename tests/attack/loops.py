"""Random scenes on the event loop, whose C is compiled by gcc with its address and
undefined-behaviour sanitizers in a part of the runs: these report nothing, and end with the same
rows and words as the optimised one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.run.compiled import build
from hapticlink.orchestrator.scene import find_scene
from tests.attack import mutations
from tests.attack.c_interface import UNDEFINED, _address_library, can_sanitize
from tests.attack.cases import Made, seeded
from tests.attack.processes import own_folder
from tests.attack.scenes import written

PATIENCE = 1200.0
"""Seconds for the scenes of one process, on a machine that is busy with other things."""
AT_A_TIME = 10
"""Scenes that a process runs."""
HOLDS = ("zoh", "foh", "lead", "second-order", "delayed", "smooth", "mean", "passive", "slope")
RUNS = """
import json, sys
if sys.argv[2]:
    from hapticlink.orchestrator.run.compiled import build
    build.name = lambda: sys.argv[2] + "/loop.so"
import hapticlink as hl
from hapticlink.orchestrator.base.errors import Fault
for scene in json.loads(sys.argv[1]):
    try:
        made = hl.run(scene)
        tables = {name: table.rows.tolist() for name, table in made.tables.items()}
        end = made.run["end"], made.run["fault"] and made.run["fault"]["message"]
        print(json.dumps([tables, end]), flush=True)
    except Fault as refused:
        print(json.dumps([{}, f"refused: {refused}"[:300]]), flush=True)
"""


def scenes(number: int, seed: int, folder: Path) -> Iterator[Path]:
    """Shipped scenes with numbers near theirs, other rates and other holds."""
    names = [*find_scene.shipped()]
    for i, _, draw in seeded(number, seed):
        tables: Any = tomllib.loads(find_scene.find(draw.choice(names))[1])
        tables["duration"] = draw.choice((0.05, 0.1, 0.2))
        for path in draw.sample([*mutations.places(tables)], 2):
            old = mutations.at(tables, path)
            if isinstance(old, float):
                mutations.at(tables, path[:-1])[path[-1]] = old * draw.uniform(0.9, 1.1)
        for key, values in {
            "hold": HOLDS,
            "coupling": ("jacobi", "gauss-seidel", "gauss-seidel-plants"),
            "isolate": (True, False),
        }.items():
            if draw.random() < 0.25:
                tables[key] = draw.choice(values)
        if draw.random() < 0.5 and "graphics" in tables:
            tables["graphics"]["rate"] = draw.choice((10, 24, 30, 60, "100/3"))
        path = folder / f"scene{i}.toml"
        path.write_text(written(tables))
        yield path


def _answers(paths: list[Path], library: str) -> tuple[list[Any], str]:
    environment = os.environ | {"PYTHONHASHSEED": "0"}
    if library:
        environment |= {
            "LD_PRELOAD": _address_library(),
            "ASAN_OPTIONS": "detect_leaks=0",
            "PYTHONMALLOC": "malloc",
            "HAPTICLINK_PURE_PYTHON": "1",  # CasADi's interpolants do not load beside sanitizers
        }
    arguments = [json.dumps([str(path) for path in paths]), library]
    try:
        ended = subprocess.run(
            [sys.executable, "-c", RUNS, *arguments],
            env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return [], "hung"
    lines = [json.loads(line) for line in ended.stdout.splitlines() if line.startswith("[")]
    return lines, "" if ended.returncode == 0 else f"{ended.returncode}: {ended.stderr[-600:]}"


def sanitized(folder: Path) -> str:
    """The folder of the loop compiled with sanitizers."""
    place = folder / "sanitized"
    place.mkdir()
    flags = (*UNDEFINED, "-fsanitize=address", "-fno-sanitize-recover=all", "-O0")
    build.compile_loop(place / "loop.so", build.Compiler(["gcc", *flags]))
    return str(place)


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` scenes; where gcc has sanitizers, a third of them with these, too, to the same
    bits."""
    with own_folder() as folder:
        library = sanitized(folder) if can_sanitize() else ""
        every = [*scenes(number, seed, folder)]
        for i in range(0, number, AT_A_TIME):
            paths = every[i : i + AT_A_TIME]
            lines, wrong = _answers(paths, "")
            others, found = lines, ""
            if library and i // AT_A_TIME % 3 == 0:
                others, found = _answers(paths, library)
            for k, path in enumerate(paths):
                pair = [*lines[k : k + 1], *others[k : k + 1]]
                outcome = "crashed" if len(pair) < 2 else _judged(*pair)
                said = wrong or found or "; ".join(str(line[1:])[:500] for line in pair)
                yield Made("event loop", f"{path.name} of seed {seed}", outcome, said)


def _judged(optimised: Any, other: Any) -> str:
    if json.dumps(optimised) != json.dumps(other):
        return "believed"  # one of them is wrong
    if str(optimised[1]).startswith("refused"):
        return "refused"
    return "told" if optimised[1][1] else "done"
