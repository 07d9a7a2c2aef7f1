"""`hapticlink bench`: needs a checkout, where benchmarks/ is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, get_args

from cyclopts import Parameter

from hapticlink.commands import checkout
from hapticlink.commands.options import Out
from hapticlink.commands.progress import bar, time_command
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import InputFault

Benchmark = Literal[
    "mechanism",
    "singular",
    "formulations",
    "local-model",
    "master",
    "cosimulation",
    "skip",
    "real-time",
    "stress",
    "view",
    "one",
    "sweep",
    "standalone",
    "engine",
    "network",
    "advise",
    "foreign",
    "waiting",
    "board",
]
"""The function `bench` of the module of this name in benchmarks/, dashes as underscores: it
measures, writes tables and figures into a folder, and returns the page."""
PAGES = {"stress": "stability/stress.md", "study": "mismatch/README.md"}
"""Pages in results/ that are not the README.md of a folder named like the benchmark."""


def bench(
    what: Benchmark | None = None,
    /,
    *,
    out: Out = None,
    quick: Annotated[bool, Parameter(negative="", help="Fewer steps, sizes and rounds.")] = False,
    stale: Annotated[
        bool, Parameter(negative="", help="Without WHAT: list only the tables of other code.")
    ] = False,
) -> int:
    """Measure run time, error and limits. Without WHAT, list which tables in results/ were made
    from the code that is there, and say on the pages of others what changed since. WHAT is one of

    - mechanism: run time against error, beside the multibody codes that are installed
    - singular: errors over many rates on motions through singular poses
    - formulations: multipliers, coordinate partitioning and symbolic embedding of a closed loop
    - local-model: cost and error of the local model
    - master: the event loop, beside the masters that are installed
    - cosimulation: run time against error of whole co-simulations
    - skip: what leaving out the unneeded saves
    - real-time: deadlines missed in real time
    - stress: hard scenes at the edge of stability and beyond, each with the outcome it has to have
    - view: deadlines missed and latencies while a browser drags
    - one: a scene as one FMU, beside its run through FMUs
    - sweep: a point of a sweep beside the loop of its run, and beside FMPy
    - standalone: a scene as a page in one file: size, and speed in a browser
    - engine: MuJoCo in the place of the graphics copy and of the mechanism
    - network: the graphics on another computer: delay, jitter and loss against error and energy
    - advise: what `hapticlink advise` is worth on test scenes
    - foreign: FMUs of others, which packages of PyPI bring, beside FMPy
    - board: a board in the loop: ticks missed, and torque after an end, a signal, a kill
    - waiting: what a user waits for: runs, verdicts, pages, and the floors beneath them

    Writes a page with tables and figures to OUT (default results/WHAT, for stress
    results/stability). An interrupted benchmark is continued by the same command.
    """
    results = checkout.folder("bench") / "results"
    if what and stale:
        raise InputFault(f"--stale lists the tables of all benchmarks: leave {what} out")
    if what is None:
        of = "stale" if stale else "status"
        told = checkout.function("bench", f"benchmarks.code_version:{of}")
        pages = {each: _page(results, each) for each in (*get_args(Benchmark), "study")}
        print(*[*told(results, pages)] or ["all tables are of the code that is there"], sep="\n")
        return 0
    make = checkout.function("bench", f"benchmarks.{what.replace('-', '_')}:bench")
    page = _page(results, what)
    page = (out or page.parent) / page.name
    page.parent.mkdir(parents=True, exist_ok=True)
    command = f"hapticlink bench {what}{' --quick' * quick}"
    with time_command(command), bar(what) as show:

        def report(text: str, done: int, total: int) -> None:
            interrupt.raise_if_interrupted()
            if show:
                show(done, total, text)

        page.write_text(make(page.parent, quick, report, command), encoding="utf-8")
    if out is None and not quick:
        checkout.function("bench", "benchmarks.code_version:sign")(results, what, page)
    print(page)
    return 0


def _page(results: Path, what: str) -> Path:
    return results / PAGES.get(what, f"{what}/README.md")
