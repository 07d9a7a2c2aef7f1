"""An attack of so many cases: `python -m tests.attack NAME [--cases N] [--seed N] [--out CSV]`.

It writes a table to results/faults, with its seed and the commit of the code; Ctrl-C ends it with
the cases that it has made. Status 1 where one was bad.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.attack import (
    archives,
    c_interface,
    cases,
    folders,
    hostile,
    loops,
    misuse,
    options,
    page,
    plugins,
    scenes,
    signals,
    signals_of_commands,
    special_files,
    ssps,
)
from tests.attack.cases import OF_SIGNALS, OUTCOMES, WITH_BELIEVED

ATTACKS: dict[str, tuple[Callable[[int, int], Iterator[cases.Made]], int, tuple[str, ...]]] = {
    "signals_of_commands": (signals_of_commands.attack, 300, OF_SIGNALS),
    "scenes": (scenes.attack, 2700, OUTCOMES),
    "options": (options.attack, 4000, OUTCOMES),
    "ssps": (ssps.attack, 400, OUTCOMES),
    "archives": (archives.attack, 500, OUTCOMES),
    "c_interface": (c_interface.attack, 500_000, c_interface.OUTCOMES),
    "signals": (signals.attack, 300, OF_SIGNALS),
    "hostile": (hostile.attack, 300, hostile.OUTCOMES),
    "folders": (folders.attack, 60, OUTCOMES),
    "special_files": (special_files.attack, 300, OUTCOMES),
    "plugins": (plugins.attack, 200, WITH_BELIEVED),
    "misuse": (misuse.attack, 500, OUTCOMES),
    "loops": (loops.attack, 300, WITH_BELIEVED),
    "page": (page.attack, 120, OUTCOMES),
}
"""By name, what makes the cases, how many by default, and the columns of their ends."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.attack", description=__doc__)
    parser.add_argument("name", choices=ATTACKS)
    parser.add_argument("--cases", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    attack, number, outcomes = ATTACKS[given.name]
    out = given.out or cases.FOLDER / f"{given.name}.csv"
    cases.hear_interrupts()
    counts = cases.counted(attack(given.cases or number, given.seed))
    cases.write(out, counts, given.seed, outcomes)
    print(out)
    return 1 if cases.bad(counts) else 0


if __name__ == "__main__":
    sys.exit(main())
