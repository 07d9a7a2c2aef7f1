"""Figures of a run, drawn in a process that loads Matplotlib while the run is prepared and goes on.

Loading it takes half as long as a short run. Where the process fails, the figures are drawn in this
one, which tells why.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from hapticlink.orchestrator.fmi.worker_process import Died, Process

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hapticlink.orchestrator.results.tables import Results

    Drawings = Sequence[tuple[str, Callable[[], Figure]]]
Pngs = list[tuple[str, bytes]]
ALLOWED = 300.0
"""Seconds for all figures."""
_process: Process | None = None


@contextmanager
def prepared() -> Iterator[None]:
    """Context in which `pngs` has such a process, unless Matplotlib is loaded already."""
    global _process
    if "matplotlib" in sys.modules:
        yield
        return
    _process = Process(__name__)
    try:
        yield
    finally:
        _process.kill()
        _process.end()
        _process = None


def pngs(results: Results) -> Pngs:
    """Name and PNG of each figure of a run."""
    if _process:
        with suppress(Died):
            _process.send(results, ALLOWED)
            answer: Pngs = _process.answer()
            return answer
    from hapticlink.visualization.figures import run_figures  # with casadi, slow to load

    return _drawn([*run_figures.drawings(results).items()])


def _drawn(drawings: Drawings) -> Pngs:
    from hapticlink.visualization.figure_axes import png

    return [(name, png(draw())) for name, draw in drawings]


def main() -> None:
    """Answers the results of a run with its figures."""
    from hapticlink.visualization.figures import run_figures

    run_figures.warm_up()
    drawings = [*run_figures.drawings(pickle.load(sys.stdin.buffer)).items()]
    drawn = _halved(drawings) if sys.platform == "linux" else _drawn(drawings)
    pickle.dump(drawn, sys.stdout.buffer)


def _halved(drawings: Drawings) -> Pngs:
    """Every second figure is drawn by a fork, which has all that is loaded."""
    reading, writing = os.pipe()
    other = os.fork()
    if not other:
        try:
            with open(writing, "wb") as file:
                pickle.dump(_drawn(drawings[1::2]), file)
        finally:
            os._exit(0)
    os.close(writing)
    made = dict(_drawn(drawings[::2]))
    with open(reading, "rb") as file:
        made |= pickle.load(file)
    os.waitpid(other, 0)
    return [(name, made[name]) for name, _ in drawings]


if __name__ == "__main__":
    with suppress(Exception):  # the caller draws, and tells of it
        main()
