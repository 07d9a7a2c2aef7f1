"""Seeded attacks of many cases: `python -m fuzz [NAME ...] [--share X] [--seed N] [--out DIR]`.

Without a name every attack is made, one after another; `--share 0.02` makes a fiftieth of its
cases. Each writes a table to results/faults, with its seed and the commit of the code, and counts
its cases as it goes; Ctrl-C ends it with the cases that it has made. Status 1 where one was bad.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from fuzz import (
    archives,
    c_interface,
    caches,
    cases,
    folders,
    hostile,
    logs,
    loop_memory,
    messages,
    misuse,
    options,
    page,
    plugins,
    scenes,
    signals,
    signals_of_commands,
    special_files,
    ssps,
    states,
)
from fuzz.cases import OF_SIGNALS, OUTCOMES, WITH_BELIEVED

ATTACKS: dict[str, tuple[Callable[[int, int], Iterator[cases.Made]], int, tuple[str, ...]]] = {
    "signals_of_commands": (signals_of_commands.attack, 300, OF_SIGNALS),
    "scenes": (scenes.attack, 2700, OUTCOMES),
    "options": (options.attack, 4000, OUTCOMES),
    "ssps": (ssps.attack, 400, OUTCOMES),
    "states": (states.attack, 500, WITH_BELIEVED),
    "archives": (archives.attack, 500, OUTCOMES),
    "c_interface": (c_interface.attack, 500_000, c_interface.OUTCOMES),
    "signals": (signals.attack, 300, OF_SIGNALS),
    "hostile": (hostile.attack, 300, hostile.OUTCOMES),
    "caches": (caches.attack, 80, OUTCOMES),
    "folders": (folders.attack, 60, OUTCOMES),
    "special_files": (special_files.attack, 300, OUTCOMES),
    "plugins": (plugins.attack, 200, WITH_BELIEVED),
    "misuse": (misuse.attack, 500, OUTCOMES),
    "logs": (logs.attack, 100, OUTCOMES),
    "messages": (messages.attack, 300, OUTCOMES),
    "loop_memory": (loop_memory.attack, 100, WITH_BELIEVED),
    "page": (page.attack, 120, OUTCOMES),
}
"""By name, what makes the cases, how many by default, and the columns of their ends."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(ATTACKS))
    parser.add_argument("--cases", type=int, help="of each attack, in place of its own number")
    parser.add_argument("--share", type=float, default=1.0, help="of its own number of cases")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=cases.FOLDER, help="folder of the tables")
    given = parser.parse_args()
    if unknown := sorted({*given.names} - {*ATTACKS}):
        parser.error(f"unknown attack: {', '.join(unknown)}; there are {', '.join(ATTACKS)}")
    cases.hear_interrupts()
    wrong = interrupted = False
    for name in given.names or ATTACKS:
        attack, usual, outcomes = ATTACKS[name]
        number = given.cases or max(1, round(usual * given.share))
        counts: cases.Counts = {}
        try:
            cases.count(attack(number, given.seed), counts, f"{name} (of {number})")
        except KeyboardInterrupt:
            interrupted = True
        out = given.out / f"{name}.csv"
        cases.write(out, counts, given.seed, outcomes)
        print(f"{out}: {dict(cases.total(counts))}", flush=True)
        wrong |= bool(cases.bad(counts))
        if interrupted:
            break
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
