"""What a user waits for: processor time of commands as they are typed, with FMUs in the cache, and
the floors beneath them: Python with the modules of a run, and the event loop alone.

Each command is a process of its own, with one thread of BLAS; of ROUNDS the least time counts,
after one more that fills the cache. The counts of a verdict (equilibria searched, operations
differentiated, products of matrices) depend on no machine.

`HAPTICLINK_BEFORE`, the command `hapticlink` of another checkout, is measured by turns with this
one, where it has what is asked for. `beside` is the ratio of both while another process runs on the
same core.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import hapticlink.analysis
import hapticlink.commands
import hapticlink.orchestrator
import hapticlink.visualization
from benchmarks import code_version
from benchmarks.page import Progress, load_average, system, table
from benchmarks.rows import Rows
from hapticlink.orchestrator.base import temporary_folders

ROUNDS = 3
COLUMNS = ("what", "before_s", "after_s", "beside", "counts")
BEFORE = "HAPTICLINK_BEFORE"
RENAMED = {"closed-loop-ideal": "closed-loop"}
"""What scenes were called in earlier checkouts."""
IMPORTS = "import hapticlink as hl, hapticlink.commands.run; hl.run"
LOOP = """
import sys
from time import process_time
from hapticlink.orchestrator import experiment
from hapticlink.orchestrator.run import execute_plan
execute_plan.perf_counter = process_time
print(experiment.simulate(sys.argv[1], "loop", csv=False).outcome.wall_time)
"""
COUNTS = """
import sys
from collections import Counter
import hapticlink as hl
from hapticlink.analysis.stability import forward_sensitivity, linear_period, resting_scene
counts = Counter(equilibria=0, slopes=0, products=0)
def count(of, name, what):
    counted = getattr(of, name)
    def call(*given):
        counts[what] += 1
        return counted(*given)
    setattr(of, name, call)
count(resting_scene, "equilibrium", "equilibria")
count(forward_sensitivity.ForwardSensitivity, "_directions", "slopes")
count(linear_period.LinearPeriod, "_step", "products")
count(linear_period._Step, "then", "products")
hl.stability(sys.argv[1], sys.argv[2:])
print(*counts.values())
"""
VERDICTS = (
    ("closed-loop-ideal",),
    ("serial",),
    ("enclosure",),
    ("two-users",),
    ("closed-loop-direct",),
    ("closed-loop-ideal", "hold=foh"),
    ("closed-loop-direct", "hold=foh"),
    ("closed-loop-ideal", "hold=model"),
)


@dataclass(frozen=True)
class Taken:
    """What a command took: processor time (s), and what it printed."""

    seconds: float
    printed: str


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes waiting.csv into `folder`."""
    packages = hapticlink.orchestrator, hapticlink.analysis, hapticlink.visualization
    code_version.begin(folder, ("waiting.csv",), *packages, hapticlink.commands)
    rows = Rows(folder / "waiting.csv", COLUMNS, 1)
    after = str(Path(sys.executable).with_name("hapticlink"))
    both = [os.environ.get(BEFORE, ""), after]
    items = [*_items(quick)]
    for k, (what, arguments) in enumerate(items):
        progress(what, k, len(items))
        if (what,) in rows:
            continue
        rows.add(what, *_measured(arguments, both, 1 if quick else ROUNDS))
    shown = [[row[column] or "-" for column in COLUMNS] for row in rows.rows.values()]
    heads = "what | before (s) | after (s) | beside a busy neighbour | equilibria, slopes, products"
    return "\n".join(
        [
            "# What a user waits for",
            "",
            *_finding(rows),
            f"Made by `{command}`: processor seconds, the least of {1 if quick else ROUNDS}, on "
            f"{system()}, at a load of {load_average():.1f}. What is measured: "
            "[waiting.py](../../benchmarks/waiting.py).",
            "",
            *table(heads, "lrrrl", shown),
            "",
        ]
    )


def _finding(rows: Rows) -> list[str]:
    """Of what is measured by turns with another checkout, the ratios after / before."""
    kinds: dict[str, list[float]] = {}
    for what, row in ((key[0], row) for key, row in rows.rows.items()):
        if row["before_s"] and not what.startswith("floor"):
            ratio = float(row["after_s"]) / float(row["before_s"])
            kinds.setdefault(what.split()[0].rstrip(","), []).append(ratio)
    said = (f"{kind} {min(r):.2g} to {max(r):.2g}" for kind, r in kinds.items())
    return [f"Processor time, after / before: {', '.join(said)}.", ""] if kinds else []


def _items(quick: bool) -> Iterator[tuple[str, list[str]]]:
    """What is measured, with the arguments of `hapticlink`, or of Python behind `-c`."""
    yield "floor: imports of a run", ["-c", IMPORTS]
    yield "floor: the loop of 3 s alone", ["-c", LOOP, "closed-loop-ideal"]
    run = ["run", "closed-loop-ideal"]
    yield "run, without figures", [*run, "--no-figures"]
    yield "run, with figures", run
    yield "page in one file, again", ["view", "closed-loop-ideal", "--standalone", "page.html"]
    for scene, *options in VERDICTS[:1] if quick else VERDICTS:
        sets = [text for option in options for text in ("--set", option)]
        yield " ".join(["stability", scene, *options]), ["stability", scene, *sets]
    if not quick:
        yield "run of 100 s, native", _long(100)
        yield "run of 1,000 s, native", _long(1000)


def _long(seconds: int) -> list[str]:
    options = [f"duration={seconds}", "packaging=native"]
    sets = [text for option in options for text in ("--set", option)]
    return ["run", "closed-loop-ideal", "--no-figures", *sets]


def _measured(
    arguments: list[str], both: list[str], rounds: int
) -> tuple[float | str, float, float | str, str]:
    with temporary_folders.temporary_folder() as room:
        known = {each: _known(each, arguments, room, both[1]) for each in both if each}
        lines = {command: line for command, line in known.items() if line}
        quiet = _least(lines, room, rounds)
        before: float | str = ""
        ratio: float | str = ""
        if len(lines) > 1:
            with _neighbour() as core:
                noisy = _least(lines, room, rounds, core)
            before, ratio = round(quiet[both[0]], 3), round(noisy[both[1]] / noisy[both[0]], 3)
        told = []
        for command, (_, scene, *options) in lines.items() if "stability" in arguments else ():
            counted = ["-c", COUNTS, scene, *options[1::2]]
            told.append(_take(command, counted, room).printed.strip())
        return before, round(quiet[both[1]], 3), ratio, " / ".join(told)


def _known(command: str, arguments: list[str], room: Path, own: str) -> list[str]:
    """Fills the cache; gives the arguments as a checkout knows them: nothing where one that is not
    our `own` has not what is asked for."""
    for each in (arguments, [RENAMED.get(text, text) for text in arguments]):
        try:
            _take(command, each, room)
        except RuntimeError:
            if command == own:
                raise
        else:
            return each
    return []


def _least(
    lines: dict[str, list[str]], room: Path, rounds: int, core: int | None = None
) -> dict[str, float]:
    """The least time (s) of each command, by turns."""
    taken = [
        {command: _take(command, line, room, core).seconds for command, line in lines.items()}
        for _ in range(rounds)
    ]
    return {command: min(each[command] for each in taken) for command in lines}


def _take(command: str, arguments: list[str], room: Path, core: int | None = None) -> Taken:
    """Carries out a command, or Python beside it; `core`: on which alone. Raises RuntimeError
    where it fails."""
    python = str(Path(command).with_name(Path(sys.executable).name))
    line = [python, *arguments] if arguments[0] == "-c" else [command, *arguments]
    places = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    with (room / "printed").open("w+") as printed:
        process = subprocess.Popen(
            line, cwd=room, stdout=printed, stderr=subprocess.STDOUT, text=True,
            env={**places, "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        if core is not None:
            os.sched_setaffinity(process.pid, {core})
        _, status, usage = os.wait4(process.pid, 0)
        printed.seek(0)
        text = printed.read()
    good = (0,) if line[1] == "-c" else (0, 1)  # 1: a verdict that is not stable
    if os.waitstatus_to_exitcode(status) not in good:
        raise RuntimeError(f"{' '.join(line)}: {text[-500:]}")
    seconds = usage.ru_utime + usage.ru_stime
    if LOOP in arguments:
        seconds = float(text.split()[-1])
    return Taken(seconds, text)


@contextmanager
def _neighbour() -> Iterator[int]:
    """A core on which another process runs."""
    core = min(os.sched_getaffinity(0))
    busy = subprocess.Popen([sys.executable, "-c", "x = [0] * 10**6\nwhile True: x.reverse()"])
    try:
        os.sched_setaffinity(busy.pid, {core})
        yield core
    finally:
        busy.kill()
        busy.wait()
