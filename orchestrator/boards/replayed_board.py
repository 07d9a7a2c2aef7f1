"""A board whose measured angles are those of an earlier run, in the place of the board itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticlink.components.specs.driver import Driver
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.boards.board import Board

MOST = 1e-9
"""Time (s) by which a recorded one may differ from that of a tick."""


@dataclass(frozen=True, kw_only=True)
class RecordedDriver(Driver):
    """A board that is read from the `columns` by name of the table of an earlier run, for the
    outputs of an FMU. Raises InputFault where one that others read is missing."""

    name: str
    columns: Mapping[str, Vector]

    def __post_init__(self) -> None:
        for port in READ:
            if f"{self.name}.{port}[1]" not in self.columns:
                what = f"{self.name}.{port} was not recorded"
                raise InputFault(f"{what}: run with record.signals = 'all', and replay that")


READ = ("q", "tau_applied")
"""What an observer reads of a board."""


class ReplayedBoard(Board):
    """A board in the place of which its recording is read; torques go nowhere."""

    def __init__(self, recorded: RecordedDriver, *arguments: Any) -> None:
        super().__init__(recorded, *arguments)
        columns, self._begun = recorded.columns, False
        self._times = columns["time"]
        names = [f"{recorded.name}.{s.name}" for s in self.description.outputs]
        self._rows = np.stack([columns[name] for name in names], axis=1)

    def begin(self) -> None:
        self._begun = True
        self.read()

    def read(self) -> None:
        if not self._begun:
            self._read_start()
            return
        time = self.place.time
        i = int(np.searchsorted(self._times, time - MOST))
        if i == len(self._times) or self._times[i] > time + MOST:
            raise self._fault("the earlier run has no row of this time", time)
        self.outputs[:] = self._rows[i]

    def step(self, time: float, end: float, size: float) -> None:
        self.place.time = end
        self.place.steps += 1
