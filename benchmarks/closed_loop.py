"""What a haptic tick of the closed loop costs, beside a loop in C over the same FMUs."""

from __future__ import annotations

from pathlib import Path
from time import thread_time

from benchmarks.peers import bare_loop
from benchmarks.rows import Rows
from benchmarks.timing import simulated

SCENE, RATE = "closed-loop", 512
DURATIONS = (3, 15)
"""Of two runs (s); their difference leaves out what each run costs once."""
COLUMNS = ("packaging", "loop", "round", "tick_us")


def alone(options: list[str], folder: Path, seconds: int) -> float:
    """Processor time (s) of the loop in C."""
    return bare_loop.seconds(SCENE, options, RATE * seconds, folder)


def recorded(options: list[str], folder: Path, seconds: int) -> float:
    """Processor time (s) of our loop."""
    given = [*options, f"duration={seconds}"]
    return simulated(SCENE, folder / "out", given, clock=thread_time).outcome.wall_time


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
