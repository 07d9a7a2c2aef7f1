"""A board in the loop: ticks missed, and how long motors keep a torque after a run has ended, was
interrupted, or was killed.

The board is the simulated one, a process behind a pseudo-terminal that writes down when its motors
change, by the same clock. A run is ended by its duration, by a signal at a random time, or by
killing its process, first without the board's watchdog, then with it but without the process that
stands by.
"""

from __future__ import annotations

import csv
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import hapticlink as hl
from benchmarks.page import Progress, load_average, system, table
from hapticlink.api.runs import with_board
from hapticlink.orchestrator import open_scene, simulated_plant
from hapticlink.orchestrator.base.signal_names import DEVICE
from hapticlink.orchestrator.base.temporary_folders import temporary_folder
from hapticlink.orchestrator.boards.driver import SIMULATED_BOARD
from hapticlink.orchestrator.boards.simulated_board import WATCHDOG
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.run.real_time import RealTimeRun
from hapticlink.orchestrator.scene.overrides import toml
from hapticlink.orchestrator.system.build_system import build_system

SCENE, RATES, SECONDS, TIMES = "closed-loop", (512, 1000), 60, 25
QUICK_SECONDS, QUICK_TIMES = 3, 2
SHORT = 0.5
"""Duration (s) of a run that is ended in some way."""
SEED, TRIES = 45, 5
OPTIONS = {"packaging": "native", **with_board(SIMULATED_BOARD)}


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> str:
    seconds, times = (QUICK_SECONDS, QUICK_TIMES) if quick else (SECONDS, TIMES)
    load, draw = load_average(), random.Random(SEED)
    missed = [_long_run(rate, seconds, progress) for rate in RATES]
    rests: dict[str, list[float]] = {}
    for way, measure in WAYS.items():
        for i in range(times):
            progress(way, i, times)
            rests.setdefault(way, []).append(measure(draw.uniform(0.2, SHORT - 0.1)))
    return page(missed, rests, seconds, load, command)


def _long_run(rate: int, seconds: int, progress: Progress) -> dict[str, Any]:
    """What became of the ticks of a long run."""
    options = OPTIONS | {"duration": seconds, "haptics.rate": rate}
    with temporary_folder() as room:
        ended = simulate(
            SCENE, room, options, lambda t: progress(f"{rate} Hz", int(t), seconds),
            real_time=RealTimeRun(),
        )  # fmt: skip
        told = ended.run["real_time"]
        return {"rate": rate, "fault": str(ended.outcome.fault or ""), **told}


def _ended(at: float) -> float:
    real_time = RealTimeRun()

    def run(scene: hl.Scene, folder: Path) -> float:
        simulate(scene, folder, (), real_time=real_time)
        return 1e-9 * real_time.pace.c.origin + scene.duration

    return _rest(run)


ALONE = """
from hapticlink.orchestrator.boards.open_kit import OpenKit
OpenKit.zero_torque_when_killed = lambda self: None
"""
"""Leaves out the process that stands by."""
RUN = """
import sys
import hapticlink as hl
seen = []
def turn(live):
    if not seen:
        seen.append(print("begun", flush=True))
try:
    hl.RealTime(sys.argv[1], [f"device.driver.port={sys.argv[2]}"]).run(turn, sys.argv[3])
except (hl.RunInterrupted, hl.Fault):
    pass
"""


def _signalled(
    number: int, alone: bool = False, watchdog: bool = False
) -> Callable[[float], float]:
    """Measures the time after a signal to the process of a run."""

    def measure(at: float) -> float:
        def run(scene: hl.Scene, folder: Path) -> float:
            assert scene.device
            assert scene.device.driver
            path = folder.with_suffix(".toml")
            keys = "".join(f"{key} = {toml(value, key)}\n" for key, value in OPTIONS.items())
            path.write_text(f'extends = "{SCENE}"\n{keys}duration = 10.0\n')
            program = (ALONE if alone else "") + RUN
            port = scene.device.driver.port
            command = [sys.executable, "-c", program, str(path), port, str(folder)]
            with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
                assert process.stdout
                process.stdout.readline()
                time.sleep(at)
                sent = time.monotonic()
                process.send_signal(number)
            time.sleep(2 * WATCHDOG)
            return sent

        return _rest(run, watchdog)

    return measure


WAYS: dict[str, Callable[[float], float]] = {
    "end of the run": _ended,
    "signal (Ctrl-C)": _signalled(signal.SIGINT),
    "killed, process that stands by": _signalled(signal.SIGKILL),
    "killed, watchdog of the board alone": _signalled(signal.SIGKILL, alone=True, watchdog=True),
}


def _rest(run: Callable[[hl.Scene, Path], float], watchdog: bool = False) -> float:
    """Time (s) from what `run` returns, by the monotonic clock, until the motors have no torque. A
    run that a loaded machine ends before its time is made once more."""
    for _ in range(TRIES):
        if (found := _rest_of_run(run, watchdog)) is not None:
            return found
    raise AssertionError("no run came to its end: the machine is too busy")


def _rest_of_run(run: Callable[[hl.Scene, Path], float], watchdog: bool) -> float | None:
    """The same of one run, None where it ended by itself before."""
    scene = open_scene.load(SCENE, OPTIONS | {"duration": SHORT})
    with temporary_folder() as room:
        log = room / "board.csv"
        with (
            build_system(scene) as built,
            simulated_plant.attach(scene, built, log, watchdog) as attached,
        ):
            driver = attached.fmu[DEVICE].driver
            assert driver
            there = open_scene.load(scene, {"device.driver.port": driver.port})
            since = run(there, room / "run")
            with log.open(newline="") as file:
                rows = [[float(cell) for cell in row] for row in csv.reader(file)]
    *before, last = rows
    if len(rows) < 3 or last[0] < since - 1e-3 or not any(before[-1][1:]):
        return None
    assert not any(last[1:]), "there is torque"
    return last[0] - since


def page(
    missed: list[dict[str, Any]],
    rests: dict[str, list[float]],
    seconds: int,
    load: float,
    command: str,
) -> str:
    """The page: ticks missed by rate, and times to rest by how a run ends."""
    heads = (
        "rate (Hz) | ticks | missed | share (%) | skipped | step time p50 | p99 | max | ended by"
    )
    ticks = (
        [r["rate"], r["ticks"], r["deadlines_missed"]]
        + [short(100 * r["deadlines_missed"] / r["ticks"]), r["skipped"]]
        + [short(1e3 * r["step_time"][k]) for k in ("p50", "p99", "max")]
        + [r["fault"] or "duration"]
        for r in missed
    )
    after = (
        [way, len(times), short(1e3 * median(times)), short(1e3 * max(times))]
        for way, times in rests.items()
    )
    lines = [
        "# A board in the loop",
        "",
        f"`{SCENE}` with native FMUs and the [simulated board](../../docs/your-device.md), a "
        f"process on a pseudo-terminal. Made by `{command}`, on {system()} and a load average of "
        f"{load:.1f} before; the loop's scheduler: {missed[0]['priority']['scheduler']}. "
        "Milliseconds.",
        "",
        f"Ticks of {seconds} s that were complete after the next was due, or were skipped:",
        "",
        *table(heads, "rrrrrrrrl", ticks),
        "",
        "Time until all motors are without torque, by the clock of the board:",
        "",
        *table("after | times | median | largest", "lrrr", after),
        "",
    ]
    return "\n".join(lines)
