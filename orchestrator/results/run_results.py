"""The results of a run while it runs, in memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.results import rows
from hapticlink.orchestrator.results.files import Recorder
from hapticlink.orchestrator.results.tables import Table

R = TypeVar("R", bound=Recorder)


class RunResults(Generic[R]):
    """Results whose recorders are of kind R. `published`: every table has a row. `folder` is where
    they are, for messages."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.published = folder, False
        self._recorders: list[R] = []

    def recorder(
        self,
        clock: str,
        columns: Sequence[str] | None,
        values: Vector,
        places: Sequence[int],
        every: int = 1,
    ) -> R:
        """The recorder of a clock. All recorders have to be created before the first row."""
        raise NotImplementedError

    def flush(self) -> None:
        """Move the rows of all clocks out of their blocks. Raises OSError, as on a full disk."""
        for recorder in self._recorders:
            recorder.flush()

    def finish(self) -> None:
        """Convert the tables of all clocks where that is asked for. Raises OSError."""

    @property
    def last(self) -> float:
        """The time (s) of the last row of the first clock."""
        return self._recorders[0].last or 0.0 if self._recorders else 0.0

    def _publish(self) -> None:
        """Called by each recorder after its first row."""
        self.published = all(recorder.last is not None for recorder in self._recorders)


class ResultsInMemory(RunResults[Recorder]):
    """Results that are never in a file. `counts`: about how many rows each clock will have."""

    def __init__(self, counts: Mapping[str, int]) -> None:
        super().__init__(Path("memory"))
        self._counts = counts
        self._clocks: list[str] = []

    def recorder(
        self,
        clock: str,
        columns: Sequence[str] | None,
        values: Vector,
        places: Sequence[int],
        every: int = 1,
    ) -> Recorder:
        """The recorder of a clock. All recorders have to be created before the first row."""
        block = None if columns is None else rows.Block(self._counts[clock], 1 + len(places))
        recorder = Recorder(columns, values, places, self._publish, every, block)
        self._recorders.append(recorder)
        self._clocks.append(clock)
        return recorder

    def tables(self) -> dict[str, Table]:
        """The tables by clock."""
        tables: dict[str, Table] = {}
        for clock, recorder in zip(self._clocks, self._recorders, strict=True):
            columns = ("time", *(recorder.columns or ()))
            recorder.flush()
            parts = recorder.parts or [np.zeros((0, len(columns)))]
            whole = parts[0] if len(parts) == 1 else np.concatenate(parts)
            tables[clock] = Table(columns, whole)
        return tables
