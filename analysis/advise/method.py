"""A method of connections between two rates, and what it does on the draws of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hapticlink.analysis.search.acceptance import AcceptanceLimits, energy_share
from hapticlink.analysis.search.settings import GAINS, HOLDS
from hapticlink.analysis.sweep.row import METRIC, Row
from hapticlink.orchestrator.results.numbers import short


@dataclass(frozen=True)
class Method:
    """A hold and gains, by their names in HOLDS and GAINS; other gains by their `own` options."""

    hold: str
    gains: str
    own: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return f"{self.hold}; gains: {self.gains}"

    @property
    def options(self) -> tuple[str, ...]:
        """The options that it consists of."""
        return (*HOLDS[self.hold], *GAINS.get(self.gains, self.own))


@dataclass(frozen=True, eq=False)
class Measured:
    """A method on the draws: largest distances of handle and operational point (mm), energies at
    the user's port as shares of what is allowed, and whether the limits are kept; and the first
    limit that is broken."""

    method: Method
    error_mm: np.ndarray
    energy: np.ndarray
    keeps: np.ndarray
    broken: str = ""

    @property
    def within(self) -> int:
        """How many draws keep the limits."""
        return int(self.keeps.sum())

    @property
    def admitted(self) -> bool:
        return self.within == len(self.error_mm)

    @property
    def line(self) -> str:
        low, middle, high = np.quantile(self.error_mm, [0.0, 0.5, 1.0])
        return (
            f"{self.method.name}: error {short(middle)} mm ({short(low)} to {short(high)}), energy "
            f"at most {short(100 * float(self.energy.max()))} % of the limit, {self.within} of "
            f"{len(self.error_mm)} draws within the limits"
        )


def measured(method: Method, rows: Sequence[Row], limits: AcceptanceLimits) -> Measured:
    """A method on the draws whose rows are given."""
    broken = [limits.why_not(row) for row in rows]
    return Measured(
        method,
        np.array([float(row.get(METRIC, np.inf)) for row in rows]),
        np.array([energy_share(row) for row in rows]),
        np.array([not why for why in broken]),
        next(filter(None, broken), ""),
    )
