"""Masters side by side: what a macro step of a ring of FMUs costs beside the FMUs themselves.

A ring of n FMUs that pass on their inputs, y = u/2 + 1, each with k reals: FMUs in C, Python FMUs
of this project and of pythonfmu. Each master runs each ring in a process of its own, by turns. And
what a haptic tick of the closed loop costs, beside a loop in C over the same FMUs.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from time import thread_time
from typing import NamedTuple

import hapticlink.orchestrator
from benchmarks import code_version, master_page, rings
from benchmarks.page import Progress
from benchmarks.peers import bare_loop
from benchmarks.peers.masters import MASTERS
from benchmarks.rows import Rows
from benchmarks.timing import simulated
from hapticlink.orchestrator.base import temporary_folders


class Case(NamedTuple):
    """packaging: see rings.py. n FMUs with `signals` reals each."""

    packaging: str
    n: int
    signals: int


NATIVE = [Case("native", n, 3) for n in (2, 4, 16, 64)]
STOCK = [Case("pythonfmu", n, 12) for n in (2, 4, 16, 64)]
OURS = [Case("python", n, 12) for n in (4, 64)]
QUICK = (NATIVE[1], NATIVE[3], STOCK[1], OURS[0])
CASES = (
    *(*NATIVE, *STOCK, *OURS),
    *(Case(of, 4, k) for of in ("native", "pythonfmu") for k in (1, 64)),
)
ROUNDS = 2
LIMIT = 600
"""Seconds after which a master is stopped."""
COLUMNS = ("packaging", "fmus", "signals", "master", "round", "step_us", "start_s", "memory_mb")
ROWS = ("rows.csv", "closed-loop-ideal.csv")
SCENE, RATE = "closed-loop-ideal", 512
DURATIONS = (3, 15)
"""Of two runs (s); their difference leaves out what each run costs once."""
TICK_COLUMNS = ("packaging", "loop", "round", "tick_us")


def measured(master: str, folder: Path) -> tuple[float, float, float]:
    """Microseconds per macro step, seconds of start-up and MB of memory of a master with the ring
    in `folder`; NaN where it is not installed or fails."""
    here = Path(__file__).parents[1]
    path = os.pathsep.join([str(here), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "benchmarks.peers.one_master", master, str(folder)]
    try:
        done = subprocess.run(
            command, env={**os.environ, "PYTHONPATH": path}, capture_output=True, timeout=LIMIT
        )
        found = json.loads(done.stdout.splitlines()[-1])
    except (subprocess.TimeoutExpired, IndexError, ValueError):
        return (float("nan"),) * 3
    return 1e6 * found["step"], found["start"], found["memory"]


def alone(options: list[str], folder: Path, seconds: int) -> float:
    """Processor time (s) of the loop in C."""
    return bare_loop.seconds(SCENE, _lasting(options, seconds), RATE * seconds, folder)


def recorded(options: list[str], folder: Path, seconds: int) -> float:
    """Processor time (s) of our loop."""
    given = _lasting(options, seconds)
    return simulated(SCENE, folder / "out", given, clock=thread_time).outcome.wall_time


def _lasting(options: list[str], seconds: int) -> list[str]:
    """FMUs refuse steps beyond the duration of their scene."""
    return [*options, f"duration={seconds}"]


def ticks(rows: Rows, rounds: int, folder: Path) -> None:
    """Add the microseconds of processor time per tick, of both loops by turns."""
    for packaging in ("native", "python"):
        fixed = [f"packaging={packaging}", "stop_when=''"]
        loops = {"C loop": alone, "hapticlink": recorded}
        for turn in range(rounds):
            for name, run in loops.items():
                if (packaging, name, turn) not in rows:
                    short, long = (min(run(fixed, folder, s) for _ in range(3)) for s in DURATIONS)
                    ticks = RATE * (DURATIONS[1] - DURATIONS[0])
                    rows.add(packaging, name, turn, 1e6 * (long - short) / ticks)


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes the tables and a figure to `folder`."""
    code_version.begin(folder, ROWS, hapticlink.orchestrator)
    cases, rounds = (QUICK, 1) if quick else (CASES, ROUNDS)
    rows = Rows(folder / ROWS[0], COLUMNS, 5)
    whole = Rows(folder / ROWS[1], TICK_COLUMNS, 3)
    with temporary_folders.temporary_folder() as room:
        for i, case in enumerate(cases):
            ring = Path(room, "-".join(map(str, case)))
            for master in (m for _ in range(rounds) for m in MASTERS):
                turn = next((r for r in range(rounds) if (*case, master, r) not in rows), None)
                if turn is None:
                    continue
                progress(f"{case.packaging}: {case.n} FMUs of {case.signals}", i, len(cases) + 1)
                if not ring.exists():
                    ring.mkdir()
                    rings.make(*case, ring)
                rows.add(*case, master, turn, *measured(master, ring))
        progress("closed-loop-ideal", len(cases), len(cases) + 1)
        ticks(whole, rounds, room)
    return master_page.page(folder, [*rows.rows.values()], [*whole.rows.values()], command)
