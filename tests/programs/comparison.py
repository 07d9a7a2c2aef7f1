"""The outputs of a program beside the rows of a run of the same scene."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fmpy.fmi1 import FMICallException

from hapticlink.fmus.check import initialize, session
from hapticlink.orchestrator.experiment import Experiment, simulate


@dataclass(frozen=True)
class Outputs:
    """Values of outputs at communication points. ticks: (n,). values: (n, outputs). discrete: those
    of sampled blocks. measured: by name, step errors at the end, and energies with the samples of
    its event."""

    names: list[str]
    ticks: np.ndarray
    values: np.ndarray
    discrete: set[str]
    measured: dict[str, float]


def outputs(path: Path, experiment: Experiment, step: int) -> Outputs:
    """The outputs of a program at communication steps of `step` ticks, up to the end of a run."""
    timeline = experiment.system.timeline
    with session(path) as opened:
        variables = opened.description.modelVariables
        chosen = [v for v in variables if v.causality == "output"]
        local = [v for v in variables if v.causality == "local"]
        slave = opened.instance()
        initialize(slave, timeline.time(0))
        references = [v.valueReference for v in chosen]
        ticks, values = [0], [slave.getReal(references)]
        while ticks[-1] + step <= timeline.end:
            try:
                slave.doStep(timeline.time(ticks[-1]), timeline.seconds(step))
            except FMICallException:
                assert experiment.outcome.reason == "stop_when", opened.messages
                break
            ticks.append(ticks[-1] + step)
            values.append(slave.getReal(references))
        measured = {v.name: slave.getReal([v.valueReference])[0] for v in local}
        if experiment.outcome.reason == "duration":  # what the last event adds to the energies
            end = timeline.time(ticks[-1])
            slave.doStep(end, timeline.seconds(1))
        energies = [v for v in local if v.name.startswith("energy.")]
        measured |= {v.name: slave.getReal([v.valueReference])[0] for v in energies}
    discrete = {v.name for v in chosen if v.variability == "discrete"}
    names = [v.name for v in chosen]
    return Outputs(names, np.array(ticks), np.array(values), discrete, measured)


def differing(found: Outputs, experiment: Experiment, skipped: str = "-") -> Iterator[str]:
    """The columns of the run, but those that begin with `skipped`, that the outputs of the program
    do not have to the bit.

    A row is compared with the communication point at which its values are there: of a plant, the
    newest row at or before it; of a sampled block, which its event may evaluate, the newest before
    it, or at it with a scheme that gets all outputs first.
    """
    timeline = experiment.system.timeline
    base, begin = float(timeline.base), float(timeline.begin)
    for table in experiment.results.tables.values():
        stamps = np.rint((table["time"] - begin) / base).astype(int)
        for column in (c for c in table.columns[1:] if not c.startswith(skipped)):
            values = found.values[:, found.names.index(column)]
            late = (0, 1) if column in found.discrete else (0,)
            rows = table[column]
            if not any(_equal(stamps, rows, found.ticks, values, k) for k in late):
                yield column


def _equal(
    stamps: np.ndarray, rows: np.ndarray, ticks: np.ndarray, values: np.ndarray, late: int
) -> bool:
    row = np.searchsorted(stamps, ticks - late, side="right") - 1
    there = row >= 0
    return np.array_equal(rows[row[there]], values[there])


def run(scene: str, options: tuple[str, ...], folder: Path) -> Experiment:
    """A run whose rows stay binary."""
    experiment = simulate(scene, folder, options, csv=False)
    assert experiment.outcome.fault is None
    return experiment
