"""What leaving out the unneeded saves: each shipped scene as it is, and with nothing skipped.

Four things are skipped, the first three each decided at one place, where `nothing_skipped` switches
it off; the last follows from what is fetched:

blocks   blocks, outputs and pairs of contacts that nothing uses are not built into FMUs
fetched  outputs that nothing reads and nobody records are not fetched
set      inputs of the project's FMUs that have not changed are not set again
request  FMUs leave out costly outputs while nobody reads them (`Variable.on_request`)

Operations are those that the FMUs' steps have executed, calls those of FMI functions that the
loop has made, values what they set or fetch: all repeat exactly. Run times are processor times of
the loop with native FMUs, in interleaved rounds in which only the signals are recorded that
connections read. "The same" compares every number that the scene as it is has in its tables, all
outputs recorded, with that of the run with nothing skipped.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import hapticlink.orchestrator
import hapticlink.scenes
from benchmarks import code_version
from benchmarks.page import Progress
from benchmarks.rows import Rows
from benchmarks.timing import simulated
from hapticlink.analysis.findings import block_costs
from hapticlink.fmus.cost import Cost
from hapticlink.fmus.fmu_functions import RARELY
from hapticlink.orchestrator import experiment
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.experiment import Experiment
from hapticlink.orchestrator.fmi import calls_of_fmi, process_cache
from hapticlink.orchestrator.fmi.setter import Setter
from hapticlink.orchestrator.fmi.variables import entry_of
from hapticlink.orchestrator.scene import blocks, find_scene
from hapticlink.orchestrator.system.timeline import timeline

COLUMNS = ("scene", "skipping", "round", "operations", "calls", "values", "run_s")
SAME = ("scene", "compared", "differ", "largest_difference", "apart")
ON, OFF = "on", "off"
ROUNDS = 7
READ = "record.signals=connected"


@contextmanager
def nothing_skipped() -> Iterator[None]:
    """Within the context, scenes are built and run with all blocks and outputs, every output is
    fetched at each communication point, and every input is set."""
    build = blocks._loop

    def always(*given: Any) -> Setter:
        setter = Setter(*given)
        setter.key = 0
        return setter

    with ExitStack() as stack:
        for module, name, instead in (
            (blocks, "_loop", lambda scene, _: build(scene, False)),
            (experiment, "choose_fetched", lambda system: system),
            (calls_of_fmi, "Setter", always),
        ):
            stack.enter_context(patch.object(module, name, instead))
        yield


def run(scene: str, folder: Path, skipping: str, *options: str) -> Experiment:
    """The scene with native FMUs, skipping ON or OFF."""
    with nothing_skipped() if skipping == OFF else nullcontext():
        return simulated(scene, folder, ["packaging=native", *options], csv=False)


def counts(made: Experiment, skipping: str) -> tuple[int, int, int]:
    """Operations executed in all steps, FMI calls, and values set or fetched by them."""
    scene, system, calls = made.scene, made.system, made.outcome.details.calls
    found = block_costs.costs(scene, timeline(scene), skip=skipping == ON)
    fetched = {
        fmu.name: {entry_of(scalar.name)[0] for scalar in fmu.description.outputs}
        for fmu in system.fmus
    }
    operations = sum(executed(c.cost, calls[c.name]["step"], fetched[c.name]) for c in found)
    moved = 0
    for fmu in system.fmus:
        inputs = sum(len(c.inputs) for c in system.into(fmu.name))
        moved += calls[fmu.name].get("get", 0) * len(fmu.description.outputs)
        moved += calls[fmu.name].get("set", 0) * inputs
    names = ("set", "step", "get")
    return operations, sum(each.get(n, 0) for each in calls.values() for n in names), moved


def executed(cost: Cost, steps: int, fetched: Collection[str]) -> int:
    """Operations of `steps` steps of an FMU of which these outputs are read after each."""
    whole = steps if cost.on_request & {*fetched} else min(steps, RARELY)
    return cost.step * whole + cost.reduced * (steps - whole)


def compared(on: Experiment, off: Experiment) -> tuple[int, int, float, str]:
    """Numbers of `on`'s tables, how many of them differ from `off`'s in a bit, the largest
    difference over the largest number of its column, and the ports that cannot be compared, since
    they have rows for what was skipped."""
    values, differ, largest, apart = 0, 0, 0.0, []
    for clock, table in on.results.tables.items():
        other = off.results.tables[clock]
        for port, names in _ports(table.columns).items():
            if names != _ports(other.columns)[port]:
                apart.append(port)
                continue
            for name in names:
                a, b = (np.ascontiguousarray(t[name], dtype=float) for t in (table, other))
                if len(a) != len(b):
                    raise RuntimeError(f"{on.scene.title}: {len(a)} and {len(b)} rows")
                values += a.size
                unequal = a.view(np.int64) != b.view(np.int64)
                if unequal.any():
                    differ += int(unequal.sum())
                    scale = float(np.abs(a).max()) or 1.0
                    largest = max(largest, float(np.abs(a - b).max()) / scale)
    return values, differ, largest, " ".join(apart)


def _ports(columns: Iterable[str]) -> dict[str, list[str]]:
    """The columns of each port."""
    found: dict[str, list[str]] = {}
    for name in columns:
        found.setdefault(entry_of(name)[0], []).append(name)
    return found


def measure(out: Path, scenes: Sequence[str], rounds: int, progress: Progress) -> tuple[Rows, Rows]:
    """The rows of runs and of comparisons, of which those on disk are not made again."""
    rows, same = Rows(out / "runs.csv", COLUMNS, keys=3), Rows(out / "same.csv", SAME, keys=1)
    total = len(scenes) * (rounds + 1)
    with process_cache.keep_unpacked(), temporary_folders.temporary_folder() as room:
        for k, scene in enumerate(scenes):
            progress(f"{scene}: the same results", k, total)
            if (scene,) not in same:
                made = {s: run(scene, room / s, s) for s in (ON, OFF)}
                same.add(scene, *compared(made[ON], made[OFF]))
        for number in range(rounds):
            for k, scene in enumerate(scenes):
                progress(f"{scene}: run time", (number + 1) * len(scenes) + k, total)
                for skipping in (ON, OFF):
                    if (scene, skipping, number) not in rows:
                        made_now = run(scene, room / skipping, skipping, READ)
                        counted = counts(made_now, skipping)
                        rows.add(scene, skipping, number, *counted, made_now.outcome.wall_time)
    return rows, same


def bench(out: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes skip.png and the rows to `out`."""
    from benchmarks import skip_page  # which imports this file

    code_version.begin(out, ("runs.csv", "same.csv"), hapticlink.orchestrator, hapticlink.scenes)
    scenes = list(find_scene.list_shipped())
    rows, same = measure(out, scenes[::6] if quick else scenes, 2 if quick else ROUNDS, progress)
    return skip_page.page(out, rows, same, command)
