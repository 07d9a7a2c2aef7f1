"""Random scenes on both event loops: the tables of the compiled loop have the bits of Python's,
where a hold extrapolates matrices its digits (`holds/holds_on_manifolds.py`), and a run that faults
ends in both with the same words. A part of them runs with the C of the loop compiled by gcc with
its address and undefined-behaviour sanitizers, which report nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

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
import json, os, sys
if sys.argv[2]:
    from hapticlink.orchestrator.run.compiled import build
    build.name = lambda: sys.argv[2] + "/loop.so"
import hapticlink as hl
from hapticlink.orchestrator.base.errors import Fault
for scene in json.loads(sys.argv[1]):
    for loop in sys.argv[3:]:
        os.environ["HAPTICLINK_LOOP"] = loop
        try:
            made = hl.run(scene)
            tables = {name: table.rows.tolist() for name, table in made.tables.items()}
            end = made.run["end"], made.run["fault"] and made.run["fault"]["message"]
            matrices = sorted(
                name for name, kind in made.run["held_as"].items()
                if kind in ("projector", "semidefinite")
            )
            print(json.dumps([tables, end, matrices]), flush=True)
        except Fault as refused:
            print(json.dumps([{}, f"refused: {refused}"[:300], []]), flush=True)
"""


def scenes(number: int, seed: int, folder: Path) -> Iterator[Path]:
    """Shipped scenes with numbers near theirs, other rates and other holds."""
    names = [*find_scene.shipped()]
    for i, _, draw in seeded(number, seed):
        tables: Any = tomllib.loads(find_scene.find_scene(draw.choice(names))[1])
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


def _answers(paths: list[Path], library: str, loops: tuple[str, ...]) -> tuple[list[Any], str]:
    environment = os.environ | {"PYTHONHASHSEED": "0"}
    if library:
        environment |= {
            "LD_PRELOAD": _address_library(),
            "ASAN_OPTIONS": "detect_leaks=0",
            "PYTHONMALLOC": "malloc",
            "HAPTICLINK_PURE_PYTHON": "1",  # CasADi's interpolants do not load beside sanitizers
        }
    arguments = [json.dumps([str(path) for path in paths]), library, *loops]
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
    """`number` scenes on both loops; where gcc has sanitizers, a third of them with these, too."""
    with own_folder() as folder:
        library = sanitized(folder) if can_sanitize() else ""
        every = [*scenes(number, seed, folder)]
        for i in range(0, number, AT_A_TIME):
            paths = every[i : i + AT_A_TIME]
            lines, wrong = _answers(paths, "", ("", "python"))
            for k, path in enumerate(paths):
                pair = lines[2 * k : 2 * k + 2]
                outcome = "crashed" if len(pair) < 2 else _judged(*pair)
                said = wrong or "; ".join(str(line[1:])[:500] for line in pair)
                yield Made("both loops", f"{path.name} of seed {seed}", outcome, said)
            if library and i // AT_A_TIME % 3 == 0:
                lines, wrong = _answers(paths, library, ("",))
                for k, path in enumerate(paths):
                    outcome = "crashed" if k >= len(lines) else _judged(lines[k], lines[k])
                    yield Made("sanitizers", f"{path.name} of seed {seed}", outcome, wrong)


def _close(compiled: Any, python: Any) -> bool:
    """Whether two runs end alike with the same numbers to rounding, which a short run amplifies
    little: each column within 1e-5 of its largest entry."""
    tables, others = compiled[0], python[0]
    return compiled[1:] == python[1:] and all(
        bool(np.all(np.abs(x - y) <= 1e-9 + 1e-5 * np.abs(y).max(axis=0)))
        for x, y in ((np.array(rows), np.array(others[name])) for name, rows in tables.items())
        if len(x)
    )


def _judged(compiled: Any, python: Any) -> str:
    if json.dumps(compiled) != json.dumps(python) and not (
        compiled[2] and _close(compiled, python)
    ):
        return "believed"  # one of them is wrong
    if str(compiled[1]).startswith("refused"):
        return "refused"
    return "told" if compiled[1][1] else "done"
