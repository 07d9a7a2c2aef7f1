"""Build time and cost of a step against the number of bodies (RK4 with projection)."""

from __future__ import annotations

import time
from pathlib import Path

from benchmarks import mechanisms
from benchmarks.our_mechanism import Ours
from benchmarks.page import Progress
from benchmarks.rows import Rows
from hapticlink.components.specs.linkage import Mechanism

COLUMNS = ("mechanism", "bodies", "build_s", "instructions", "vm_us", "c_us")
STEPS = 500


def measure(out: Path, quick: bool, progress: Progress) -> list[dict[str, str]]:
    rows = Rows(out / "growth.csv", COLUMNS, keys=2)
    sizes = (5, 10, 20) if quick else (5, 10, 20, 40, 80, 160)
    wanted = [("serial chain", n, mechanisms.chain(n)) for n in sizes]
    wanted += [("N-four-bar", 2 * (n // 2) + 1, mechanisms.n_four_bar(n // 2)) for n in sizes]
    for k, (name, bodies, linkage) in enumerate(wanted):
        progress(f"growth: {name} of {bodies}", k, len(wanted))
        if (name, bodies) in rows:
            continue
        builds = []
        for _ in range(2):
            ours, began = Ours(linkage, (0.0, 0.0, 0.0), Mechanism(), 1e-4), time.perf_counter()
            count = ours.component.step.n_instructions()
            builds.append(time.perf_counter() - began)
        runs = [ours.virtual_machine()]
        if bodies <= 100:  # the compiler's own time grows faster than the code
            runs.append(ours.native(out / ".compiled"))
        costs = [min(run(STEPS)[2] for _ in range(3)) / STEPS * 1e6 for run in runs]
        rows.add(name, bodies, min(builds), count, *costs, *[float("nan")] * (2 - len(costs)))
    return list(rows.rows.values())
