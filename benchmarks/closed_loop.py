"""What a haptic tick of the closed loop costs, beside a loop in C over the same FMUs."""

from __future__ import annotations

from pathlib import Path
from time import thread_time

from benchmarks.peers import bare_scene
from benchmarks.rows import Rows
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.run import execute_plan

SCENE, RATE = "closed-loop", 512
DURATIONS = (3, 15)
"""Of two runs (s); their difference leaves out what each run costs once."""
COLUMNS = ("packaging", "loop", "round", "tick_us")


def alone(options: list[str], folder: Path, seconds: int) -> float:
    """Processor time (s) of the loop in C."""
    return bare_scene.seconds(SCENE, options, RATE * seconds, folder)


def recorded(options: list[str], folder: Path, seconds: int) -> float:
    """Processor time (s) of our loop."""
    execute_plan.perf_counter, before = thread_time, execute_plan.perf_counter
    try:
        ended = simulate(SCENE, folder / "out", [*options, f"duration={seconds}"]).outcome
    finally:
        execute_plan.perf_counter = before
    assert ended.fault is None
    return ended.wall_time


def measure(rows: Rows, rounds: int, folder: Path) -> None:
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
