"""Random scenes on the event loop compiled by gcc with its address and undefined-behaviour
sanitizers, which end the process with a report where the loop's C reads or writes elsewhere. Each
scene runs without them first, which builds its FMUs, and ends with them as it does without."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fuzz import mutations
from fuzz.c_interface import UNDEFINED, can_sanitize, sanitizer_environment
from fuzz.cases import Made, seeded
from fuzz.processes import own_folder
from fuzz.scenes import written
from hapticlink.orchestrator.run.compiled import build
from hapticlink.orchestrator.scene import find_scene

PATIENCE = 1200.0
"""Seconds for the scenes of one process, on a machine that is busy with other things."""
AT_A_TIME = 10
"""Scenes that a process runs."""
HOLDS = ("zoh", "foh", "lead", "second-order", "delayed", "smooth", "mean", "passive", "slope")
RUNS = """
import json, sys
if sys.argv[2]:
    from hapticlink.orchestrator.run.compiled import build
    build.name = lambda: sys.argv[2]
import hapticlink as hl
from hapticlink.orchestrator.base.errors import Fault
for scene in json.loads(sys.argv[1]):
    try:
        outcome = "told" if hl.run(scene).run["fault"] else "done"
    except Fault:
        outcome = "refused"
    print(json.dumps(outcome), flush=True)
"""
"""Runs scenes, with the library of argv[2] where one is given, and prints what became of each."""


def scenes(number: int, seed: int, folder: Path) -> Iterator[Path]:
    """Shipped scenes with numbers near theirs, other rates and other holds."""
    names = [*find_scene.list_shipped()]
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


def sanitized_loop(folder: Path) -> Path:
    """The loop compiled with sanitizers, in `folder`."""
    flags = (*UNDEFINED, "-fsanitize=address", "-fno-sanitize-recover=all", "-O0")
    library = folder / "loop.so"
    build.compile_loop(library, build.Compiler(["gcc", *flags]))
    return library


def _outcomes(paths: list[Path], library: Path | None = None) -> tuple[list[str], str]:
    """What became of each scene up to a crash, and what was wrong then."""
    environment = {**os.environ}
    if library:  # CasADi's interpolants do not load beside sanitizers
        environment |= sanitizer_environment() | {"HAPTICLINK_PURE_PYTHON": "1"}
    arguments = [json.dumps([str(path) for path in paths]), str(library or "")]
    try:
        ended = subprocess.run(
            [sys.executable, "-c", RUNS, *arguments],
            env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return [], f"no end after {PATIENCE:g} s"
    found = [json.loads(line) for line in ended.stdout.splitlines() if line.startswith('"')]
    return found, "" if ended.returncode == 0 else f"{ended.returncode}: {ended.stderr[-600:]}"


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` scenes, where gcc has sanitizers."""
    if not can_sanitize():
        return
    with own_folder() as folder:
        library = sanitized_loop(folder)
        every = [*scenes(number, seed, folder)]
        for i in range(0, number, AT_A_TIME):
            paths = every[i : i + AT_A_TIME]
            plain, wrong = _outcomes(paths)
            found: list[str] = []
            if len(plain) == len(paths):
                found, wrong = _outcomes(paths, library)
            for k, path in enumerate(paths):
                outcome, said = found[k] if k < len(found) else "crashed", wrong
                if outcome != "crashed" and outcome != plain[k]:
                    outcome, said = "believed", f"{outcome}; without sanitizers {plain[k]}"
                yield Made("sanitizers", f"{path.name} of seed {seed}", outcome, said)
