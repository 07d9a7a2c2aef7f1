"""`python -m studies.observer`: what has no row in sweeps/observer yet is run, and results/observer
written."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from hapticlink.orchestrator.base import plugins


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m studies.observer", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/observer"))
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    plugins.load(("studies.observer.plugin",))
    from hapticlink.analysis.sweep import table
    from hapticlink.analysis.sweep.run_sweep import Means, sweep
    from studies.observer import cases, measure, page

    jobs = cases.jobs()

    def tell(done: int, of: int) -> None:
        if done % max(1, of // 20) == 0:
            print(f"{done} of {of} runs", flush=True)

    rows = sweep(jobs, Means(Path("sweeps/observer"), asked.jobs, tell), measure.of_run)
    asked.out.mkdir(parents=True, exist_ok=True)
    table.write(asked.out / "runs.csv", [page.rounded(row) for row in rows])
    print(page.write(asked.out, rows))


if __name__ == "__main__":
    main()
