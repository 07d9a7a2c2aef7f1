"""What a tick costs with the hold `model`, beside `foh`:

    python -m studies.model_hold.cost results/model

`closed-loop-direct` at RATES of the graphics, with native FMUs. Processor time (us) of a haptic
tick, by runs of SHORT and LONG (s), whose difference leaves the start out; the least of ROUNDS, in
each of which both holds take their turn. Writes cost.csv.
"""

from __future__ import annotations

import csv
import sys
import time
from itertools import product
from pathlib import Path

from hapticlink.analysis.search.settings import EARLY, HOLDS
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.scene.scene import Scene

METHODS = ("foh", EARLY)
RATES = (30, 60)
"""At which both are stable: a run that ends early costs less."""
SHORT, LONG, ROUNDS = 1, 101, 7
TICKS = 512 * (LONG - SHORT)


def scene(hold: str, rate: int, seconds: int) -> Scene:
    own = ("packaging=native", "controller.bias=full", "sensing=ideal", "directions_from=mechanism")
    options = [*own, *HOLDS[hold], f"graphics.rate={rate}", f"duration={seconds}"]
    return open_scene.load("closed-loop-direct", options)


def seconds_of(read: Scene) -> float:
    """Processor time (s) of a run, whose results stay in memory."""
    with temporary_folders.temporary_folder() as room:
        begin = time.process_time()
        found = simulate(read, room / "run", csv=False, in_memory=True)
        seconds = time.process_time() - begin
    assert found.outcome.reason == "duration", found.outcome
    return seconds


def main(folder: Path) -> None:
    """Writes the table."""
    cells = {
        (hold, rate): [scene(hold, rate, seconds) for seconds in (SHORT, LONG)]
        for rate, hold in product(RATES, METHODS)
    }
    least = {cell: [float("inf")] * 2 for cell in cells}
    for _ in range(ROUNDS):
        for cell, both in cells.items():
            least[cell] = [min(a, seconds_of(b)) for a, b in zip(least[cell], both, strict=True)]
    with (folder / "cost.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("graphics_hz", "hold", "us_per_tick"))
        for rate, hold in product(RATES, METHODS):
            short, long = least[hold, rate]
            row = rate, hold, f"{1e6 * (long - short) / TICKS:.2f}"
            table.writerow(row)
            print(*row, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else "results/model"))
