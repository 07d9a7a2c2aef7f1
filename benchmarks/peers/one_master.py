"""One master with one ring in a process of its own, so that start-up and memory are its alone:
`python -m benchmarks.peers.one_master MASTER FOLDER` prints them as JSON."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from time import perf_counter, process_time

from benchmarks.peers.masters import MASTERS, Ring, Steps

ENOUGH = 0.03
"""Seconds that the shorter of two runs takes at least."""
ROOM = 0.4
"""Seconds over which both are repeated, at least once."""


def steps_of(run: Steps) -> int:
    """Macro steps that take `ENOUGH`."""
    steps = 20
    while min(run(steps), run(steps)) < ENOUGH:
        steps *= 4
    return steps


def per_step(run: Steps, steps: int) -> float:
    """Seconds per macro step: (t(5 N) - t(N)) / 4 N, of the least of several, so that what each run
    costs once cancels."""
    times: list[tuple[float, float]] = []
    end = perf_counter() + ROOM
    while len(times) < 2 or perf_counter() < end:
        times.append((run(steps), run(5 * steps)))
    short, long = (min(found) for found in zip(*times, strict=True))
    return (long - short) / (4 * steps)


def peak_memory() -> float:
    """MB that the process has had in memory at most; the operating system counts what came before
    exec in ru_maxrss, too."""
    status = Path("/proc/self/status")
    if status.exists():
        line = next(x for x in status.read_text().splitlines() if x.startswith("VmHWM"))
        return int(line.split()[1]) / 1024
    import resource

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / (2**20 if sys.platform == "darwin" else 2**10)


def main() -> None:
    name, folder = sys.argv[1], Path(sys.argv[2])
    run = MASTERS[name](Ring(folder))
    start = process_time()
    steps = steps_of(run)
    memory = peak_memory()  # before runs are repeated: each makes new FMUs in hapticlink
    print(json.dumps({"start": start, "step": per_step(run, steps), "memory": memory}))
    sys.stdout.flush()
    os._exit(0)  # FMUs are not freed: some masters crash when they unload a library of Python FMUs


if __name__ == "__main__":
    main()
