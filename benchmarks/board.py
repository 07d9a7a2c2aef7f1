"""A board in the loop: ticks missed, what the bytes wait for, and how long motors keep a torque
after a run has ended, was interrupted, was at fault, or was killed.

The board is the simulated one, a process on a pseudo-terminal that writes down when its motors
change, by the same clock. In each injection a run has had torques for a random time when it is
ended; that it is seen to end is the board's own last row, without torque. A run that ends before,
as on a machine that stops it, is counted and made once more.
"""

from __future__ import annotations

import csv
import json
import math
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from statistics import median
from subprocess import PIPE

from benchmarks import cyclictest
from benchmarks.page import Progress, load_average, system, table
from benchmarks.rows import Rows
from hapticlink.api.runs import with_board
from hapticlink.orchestrator import open_scene, simulated_plant
from hapticlink.orchestrator.base.signal_names import DEVICE
from hapticlink.orchestrator.base.temporary_folders import temporary_folder
from hapticlink.orchestrator.boards.driver import SIMULATED_BOARD
from hapticlink.orchestrator.boards.simulated_board import WATCHDOG
from hapticlink.orchestrator.boards.zero_torque_when_killed import WORKERS_PRIORITY
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.run.real_time_priority import PRIORITY, raise_beside
from hapticlink.orchestrator.scene.overrides import toml
from hapticlink.orchestrator.system.build_system import build_system

SCENE, RATES, SECONDS, TIMES = "closed-loop", (512, 1000), 60, 25
QUICK_SECONDS, QUICK_TIMES = 3, 2
ENDS = 0.5
"""Duration (s) of a run that ends by itself."""
SEED, TRIES = 45, 10
OPTIONS = {"packaging": "native", **with_board(SIMULATED_BOARD)}


Rowed = Sequence[Mapping[str, str]]


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes ticks.csv, ways.csv and rests.csv into `folder`; rows that are there are kept."""
    seconds, times = (QUICK_SECONDS, QUICK_TIMES) if quick else (SECONDS, TIMES)
    ticks = Rows(folder / "ticks.csv", TICKS, 2)
    for rate, workers in product(RATES, WORKERS):
        if (rate, workers) not in ticks:
            ticks.add(rate, workers, *_long_run(rate, workers, seconds, progress))
    ways = Rows(folder / "ways.csv", WAYS, 2)
    for number, way in product(range(2 if quick else BLOCKS), WAYS_OF_BYTES):
        progress(way, number, BLOCKS)
        if (way, number) not in ways:
            ways.add(way, number, *_round_trips(way))
    rests, draw = Rows(folder / "rests.csv", RESTS, 2), random.Random(SEED)
    for number in range(times):
        for i, rule in enumerate(RULES):
            delay = draw.uniform(0.05, 0.3)
            progress(rule, number * len(RULES) + i, times * len(RULES))
            if (rule, number) not in rests:
                rests.add(rule, number, *_rest(rule, delay))
    found = [[*rows.rows.values()] for rows in (ticks, ways, rests)]
    return page(found[0], found[1], found[2], seconds, command)


# --- ticks ----------------------------------------------------------------------------------

TICKS = (
    *("rate", "workers", "ticks", "missed", "skipped", "p50", "p99", "max", "ended", "scheduler"),
    *("told", "load", "wakings", "woken_late", "latest"),
)
"""Of a long run: step times (ms), what it says of the kernel's workers, and how late cyclictest
woke beside it: the number of wakings, of those that were later than a period, and the latest
(ms)."""
WORKERS: Mapping[str, Sequence[str]] = {
    "raised": (),
    "normal": ("chrt", "-f", str(PRIORITY), "setpriv", "--bounding-set=-sys_nice"),
}
"""The kernel's workers that pass the bytes on, and what a run is started by: the second one is a
user's who may raise his own priority alone."""


def _long_run(rate: int, workers: str, seconds: int, progress: Progress) -> Iterator[object]:
    """What became of the ticks of a long run."""
    keys = {"packaging": "native", "duration": seconds, "haptics.rate": rate}
    changes = (f"--set={key}={value}" for key, value in keys.items())
    with temporary_folder() as room, cyclictest.beside(rate, PRIORITY) as latencies:
        options = ("--real-time", "--no-figures", "--quiet", "--device", SIMULATED_BOARD)
        command = [sys.executable, "-m", "hapticlink", "run", SCENE, *options, *changes]
        begun = time.monotonic()
        with subprocess.Popen([*WORKERS[workers], *command, "--out", str(room / "run")]) as process:
            while process.poll() is None:
                progress(f"{rate} Hz", int(time.monotonic() - begun), seconds)
                time.sleep(0.5)
        load, said = load_average(), json.loads((room / "run" / "run.json").read_text())
    told = said["real_time"]
    yield from (told["ticks"], told["deadlines_missed"], told["skipped"])
    yield from (1e3 * told["step_time"][k] for k in ("p50", "p99", "max"))
    yield said["fault"]["message"] if said["fault"] else said["end"]["reason"]
    yield from (told["priority"]["scheduler"], told["priority"]["workers"], round(load, 1))
    for woken in latencies:
        yield from (woken.wakings, woken.later_than(1 / rate), 1e-3 * woken.largest)
    if not latencies:
        yield from ("", "", "")


# --- ways of the bytes ------------------------------------------------------------------------

WAYS, BLOCKS = ("way", "number", "trips", "p50", "p99", "max", "long"), 5
"""Of blocks of round trips of a message between two processes of the loop's priority: times (ms),
and how many took longer than LONG."""
TRIPS, LONG = 3000, 1 / 512
RAISED = "pseudo-terminal, workers raised"
WAYS_OF_BYTES = ("socket", "pseudo-terminal", RAISED)
ROUND_TRIPS = """
import os, select, socket, sys, time, tty
from hapticlink.orchestrator.boards.stand_by import raise_workers
way, trips, rate, priority, workers = sys.argv[1], *map(int, sys.argv[2:])
if way == "socket":
    server = socket.create_server(("127.0.0.1", 0))
    ends = [socket.create_connection(server.getsockname()), server.accept()[0]]
    for end in ends:
        end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    host, board = (end.fileno() for end in ends)
else:
    board, host = os.openpty()
    tty.setraw(host)
child = os.fork()
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
except OSError:
    pass
while not child:
    select.select([board], [], [])
    message = os.read(board, 100)
    os.write(board, message)
    if message[:1] == b"e":
        os._exit(0)
def ask():
    begun = time.perf_counter()
    for k in range(trips):
        if (left := begun + k / rate - time.perf_counter()) > 0:
            time.sleep(left)
        sent, size = time.perf_counter(), 0
        os.write(host, (b"e" if k == trips - 1 else b"t") * 18)
        while size < 18:
            select.select([host], [], [])
            size += len(os.read(host, 18))
        print(time.perf_counter() - sent)
if workers:
    with raise_workers(workers):
        ask()
else:
    ask()
"""


def _round_trips(way: str) -> Iterator[object]:
    numbers = map(str, (TRIPS, 512, PRIORITY, WORKERS_PRIORITY if way == RAISED else 0))
    command = [sys.executable, "-c", ROUND_TRIPS, way, *numbers]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    taken = sorted(map(float, said.split()))
    yield len(taken)
    yield from (1e3 * taken[int(share * (len(taken) - 1))] for share in (0.5, 0.99, 1.0))
    yield sum(t > LONG for t in taken)


# --- torque after an end ----------------------------------------------------------------------

RESTS = ("rule", "number", "ms", "repeated", "latest", "load")
"""Of an injection: the time (ms) from it to the board's motors without torque, the number of runs
before it that ended by themselves, and how late (ms) cyclictest of the loop's priority woke at most
in the seconds of its run."""
PROGRAM = """
import sys, time
from hapticlink.orchestrator.boards.open_kit import OpenKit
from hapticlink.orchestrator.boards.safe_torques import SafeTorques
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.run.real_time import RealTimeRun
scene, folder, (delay, duration) = *sys.argv[1:3], map(float, sys.argv[3:])
begun, told, limit, counts = [], [], SafeTorques.limit, OpenKit.counts
def tell(now):
    if not told:
        told.append(print(repr(now), flush=True))
def due(by=0.0):
    "Whether a fault is due, a time after the first torques; says when it was."
    now = time.monotonic()
    ready = bool(begun) and now > begun[0] + delay
    if ready:
        tell(now + by)
    return ready
def note_begin(self, torques, step):
    sent = limit(self, torques, step)
    if any(sent) and not begun:
        begun.append(time.monotonic())
    return sent
SafeTorques.limit = note_begin
INJECTION
real_time = RealTimeRun()
simulate(scene, folder, {"duration": duration}, real_time=real_time)
tell(1e-9 * real_time.pace.c.origin + duration)
"""
"""A run that says when it was ended, by the monotonic clock (s): when the fault was that is put
into it, or when its last tick was due."""
KEY = b" "
How = str | bytes | signal.Signals
RULES: Mapping[str, How] = {
    "end of the run": "",
    "a key": KEY,
    "Ctrl-C (SIGINT)": signal.SIGINT,
    "SIGTERM": signal.SIGTERM,
    "torque that is not finite": """
def poisoned(self, torques, step):
    return note_begin(self, [float("nan")] * len(torques) if due() else torques, step)
SafeTorques.limit = poisoned
""",
    "encoder that jumps": """
OpenKit.counts = lambda self, answer: [c + 2000 * due() for c in counts(self, answer)]
""",
    "answer that lacks a byte": """
OpenKit.counts = lambda self, answer: counts(self, answer[1:] + answer[:1] if due() else answer)
""",
    "no answer, from `silence` after the question": """
receive = OpenKit.receive
def deaf(self, seconds):
    if due(seconds):
        receive(self, seconds)
    return receive(self, seconds)
OpenKit.receive = deaf
""",
    "killed (SIGKILL): process that stands by": signal.SIGKILL,
    "stopped (SIGSTOP): watchdog of the board": signal.SIGSTOP,
}
"""How runs are ended: a signal, a key of the terminal, or what is put into their program."""


def _rest(rule: str, delay: float) -> tuple[float, int, float, float]:
    """Time (ms) from what ends a run, a time (s) after its first torques, until the motors have no
    torque by the log of the board, and the rest of RESTS."""
    for repeated in range(TRIES):
        with temporary_folder() as room, cyclictest.beside(1000, PRIORITY) as latencies:
            since, rows = _injected(RULES[rule], delay, room)
        latest = max((1e-3 * each.largest for each in latencies), default=math.nan)
        before = [any(torques) for now, *torques in rows if now <= since]
        after = [(now, any(torques)) for now, *torques in rows if now > since]
        if before and before[-1] and after and not after[-1][1]:
            last = max((i for i, (_, there) in enumerate(after) if there), default=-1)
            return 1e3 * (after[last + 1][0] - since), repeated, latest, round(load_average(), 1)
    raise AssertionError(f"{rule}: no run came to its end: the machine is too busy")


def _injected(how: How, delay: float, room: Path) -> tuple[float, Log]:
    """When a run was ended by the monotonic clock (s), and the rows of the board's log: times and
    torques."""
    duration = 10.0 if how else ENDS
    scene = open_scene.load(SCENE, OPTIONS | {"duration": duration})
    log, path = room / "board.csv", room / "scene.toml"
    with (
        build_system(scene) as built,
        simulated_plant.attach(scene, built, log, how is signal.SIGSTOP) as attached,
    ):
        driver = attached.fmu[DEVICE].driver
        assert driver
        keys = OPTIONS | {"device.driver.port": driver.port}
        text = "".join(f"{key} = {toml(value, key)}\n" for key, value in keys.items())
        path.write_text(f'extends = "{SCENE}"\n{text}')
        keyboard, terminal = os.openpty()
        if isinstance(how, str):
            program = PROGRAM.replace("INJECTION", how)
            options = ["-c", program, *map(str, (path, room / "run", delay, duration))]
        else:
            options = ["-m", "hapticlink", "run", str(path), "--real-time", "--no-figures"]
            options += ["--set", f"duration={duration:g}", "--out", str(room / "run")]
        with subprocess.Popen(
            [sys.executable, *options], stdin=terminal, stdout=PIPE, stderr=PIPE, text=True,
            # As in a terminal: what a shell has in the background would ignore it.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        ) as process:  # fmt: skip
            os.close(terminal)
            assert process.stdout
            if isinstance(how, str):
                since = float(process.stdout.readline() or "nan")
                process.communicate()
            else:
                while process.poll() is None and not any(any(row[1:]) for row in _read(log)):
                    time.sleep(0.01)
                time.sleep(delay)
                press, kill = partial(os.write, keyboard), process.send_signal
                act = partial(press, how) if isinstance(how, bytes) else partial(kill, how)
                with ThreadPoolExecutor(1) as thread:
                    since = thread.submit(_strike, act).result()
                time.sleep(3 * WATCHDOG)
                process.kill()
        os.close(keyboard)
        return since, _read(log)


def _strike(act: Callable[[], object]) -> float:
    """When something was done, by the monotonic clock (s): with a priority at which the machine
    does not stop this thread in between."""
    raise_beside()
    since = time.monotonic()
    act()
    return since


Log = list[list[float]]


def _read(log: Path) -> Log:
    with log.open(newline="") as file:
        return [[float(cell) for cell in row] for row in csv.reader(file) if row]


# --- page -------------------------------------------------------------------------------------


def page(ticks: Rowed, ways: Rowed, rests: Rowed, seconds: int, command: str) -> str:
    """The page: ticks missed by rate, round trips by way, and times to rest by how a run ends."""
    heads = (
        "rate (Hz) | kernel's workers | ticks | missed | share (%) | skipped | step time p50 | "
        "p99 | max | ended by | load | cyclictest later than a period | latest"
    )
    missed = (
        (
            *(r["rate"], r["told"], r["ticks"], r["missed"], _share(r["missed"], r["ticks"])),
            *(r["skipped"], *(short(float(r[key])) for key in ("p50", "p99", "max"))),
            *(r["ended"], r["load"], f"{r['woken_late']} of {r['wakings']}"),
            short(float(r["latest"] or "nan")),
        )
        for r in ticks
    )
    trips = []
    for way in WAYS_OF_BYTES:
        blocks = [r for r in ways if r["way"] == way]
        long, every = (sum(int(r[k]) for r in blocks) for k in ("long", "trips"))
        middle = (short(median(float(r[k]) for r in blocks)) for k in ("p50", "p99"))
        largest = short(max(float(r["max"]) for r in blocks))
        trips.append([way, every, *middle, largest, long, _share(long, every)])
    after = []
    for rule in RULES:
        found = sorted((float(r["ms"]), float(r["latest"])) for r in rests if r["rule"] == rule)
        times = [ms for ms, _ in found]
        ninth = times[math.ceil(0.9 * len(times)) - 1]
        numbers = (median(times), ninth, *found[-1])
        after.append([rule, len(times), *map(short, numbers)])
    again = sum(int(r["repeated"]) for r in rests)
    loads = [float(r["load"]) for r in rests]
    machine = [float(r["latest"]) for r in rests]
    trip_heads = "way | trips | p50 | p99 | max | longer than 1/512 s | share (%)"
    lines = (
        "# A board in the loop",
        "",
        f"`{SCENE}` with native FMUs and the [simulated board](../../docs/your-device.md), a "
        f"process on a pseudo-terminal. Made by `{command}`, on {system()}; the loop's scheduler: "
        f"{ticks[0]['scheduler']}, and so the board's. Milliseconds.",
        "",
        "The bytes of a pseudo-terminal, as those of a serial port, are passed on by workers of "
        "the kernel, which have the normal priority: on a busy machine they wait for others. A run "
        "with a board raises them where its user may (root, or CAP_SYS_NICE). Without that right, "
        "as a user whose `ulimit -r` lets him raise the loop alone, a real board at a serial port "
        "meets the rows `normal`; a board behind a network does not depend on them.",
        "",
        f"Ticks of {seconds} s that were complete after the next was due, or were skipped, and how "
        "`cyclictest` of the same rate and priority woke in the same time. Load: the average of "
        "the minute at the end, with the run itself.",
        "",
        *table(heads, "rlrrrrrrrlrrr", missed),
        "",
        f"Round trips of 18 bytes between two processes of that priority, {TRIPS} in a block at "
        "512 Hz, blocks of the ways in turns (p50, p99: medians of blocks).",
        "",
        *table(trip_heads, "lrrrrrr", trips),
        "",
        "Time until all motors are without torque, by the clock and the log of the board, whose "
        "watchdog is off but in the last row; beside the largest time, how late `cyclictest` of "
        "the same priority woke at most in the seconds of that run. The latest that it woke in a "
        f"run was {short(median(machine))} ms in the median of all, and {short(max(machine))} at "
        f"most, at loads of {min(loads):g} to {max(loads):g}. Runs that ended before they were "
        f"to, and were made once more: {again}.",
        "",
        *table(
            "after | times | median | 9 of 10 within | largest | cyclictest then", "lrrrrr", after
        ),
        "",
    )
    return "\n".join(lines)


def _share(part: str | int, whole: str | int) -> str:
    return short(100 * int(part) / int(whole))
