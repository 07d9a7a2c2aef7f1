"""What attacks share: what may become of a case, the count of each, and the table."""

from __future__ import annotations

import csv
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

OUTCOMES = ("done", "refused", "told", "lost", "crashed", "hung")
"""done: accepted and run; refused: status 2 and a message; told: status 1 and a message, results up
to then kept; lost: results of an earlier run are gone, or something stays behind; crashed: a
signal, a traceback, an error of ours; hung: beyond a stated bound."""
WITH_BELIEVED = (*OUTCOMES, "believed")
"""believed: what is wrong was taken for right."""
OF_SIGNALS = ("before", "done", "told", "lost", "crashed", "hung")
"""before: a signal in Python's own start; done: after the last thing that asks."""
BAD = ("lost", "crashed", "hung", "believed")
FOLDER = Path("results/faults")
Counts = dict[str, Counter[str]]
"""Outcomes by kind."""


@dataclass(frozen=True)
class Made:
    """A case that was made: a row of the table, what it was, one of the outcomes and, where that
    is a bad one, what was wrong."""

    kind: str
    case: str
    outcome: str
    wrong: str = ""


def seeded(number: int, seed: int) -> Iterator[tuple[int, str, random.Random]]:
    """(i, its name, what draws it) of each case."""
    for i in range(number):
        yield i, f"number {i} of seed {seed}", random.Random(f"{seed} {i}")


def count(made: Iterable[Made], counts: Counts, label: str) -> None:
    """Adds each outcome to its kind in `counts`; stderr gets what was wrong, and how many cases
    there are, every five seconds."""
    told = time.monotonic()
    for i, each in enumerate(made, 1):
        counts.setdefault(each.kind, Counter())[each.outcome] += 1
        if each.outcome in BAD:
            line = f"case {i}, {each.kind}: {each.case}: {each.outcome}: {each.wrong}"
            print(line, file=sys.stderr, flush=True)
        if time.monotonic() > told + 5.0:
            told = time.monotonic()
            print(f"{label}: {i} cases", file=sys.stderr, flush=True)


def total(counts: Counts) -> Counter[str]:
    """Outcomes of all kinds."""
    return sum(counts.values(), Counter())


def bad(counts: Counts) -> dict[str, int]:
    """How many cases had each bad outcome; empty where none had."""
    return {outcome: n for outcome, n in total(counts).items() if n and outcome in BAD}


def write(
    path: Path,
    counts: Counts,
    seed: int,
    outcomes: Sequence[str] = OUTCOMES,
) -> None:
    """A row a kind: `attack,cases,`, a column an outcome, the seed and the commit of the code."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["attack", "cases", *outcomes, "seed", "commit"])
        for kind, found in counts.items():
            row = [kind, found.total(), *(found[o] for o in outcomes)]
            writer.writerow([*row, seed, COMMIT])


def _commit() -> str:
    """Of the checkout, "+" where its files have changed since."""
    git = ["git", "-C", str(Path(__file__).parent)]
    asked = [[*git, "rev-parse", "--short=7", "HEAD"], [*git, "status", "--porcelain", "-uno"]]
    head, changed = (
        subprocess.run(each, capture_output=True, text=True, check=False).stdout.strip()
        for each in asked
    )
    return f"{head}+" if changed else head


COMMIT = _commit()
"""When the attack began: its processes read what stands on the disk."""


def hear_interrupts() -> None:
    """Processes that this one starts hear SIGINT, which a shell ignores in the background."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
