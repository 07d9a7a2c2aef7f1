"""Growth rates of the lifted map with early steps against those of runs:

    python -m studies.model_growth

20 cells of the hold `model` with the mechanism at the graphics rate, each in a spring hand whose
target lies OFF beside the start. Writes results/model/growth.csv, the largest growth rate (1/s) by
the map at its equilibrium and by a run, which knows nothing of the map.

Next to rest `reaction` is `half-lead`, which is what the map has. So each cell is run from FAR,
too: what is left of the handle's motion (um, from end to end in the last quarter of the run,
infinite where the run diverges), with either of both.

And the margin: the factor on the stiffnesses up to which the map is stable, or drifts at most, with
the growth rates of map and run to both sides of it, BESIDE.

The rate of a run is that of its slowest decay, or of its growth. Windows of it would mix modes that
decay nearly alike, so it is that of the leading mode that `run_modes.py` fits to the handle's
velocities of whole periods of the map.
"""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Iterator
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import hapticlink as hl
from hapticlink.analysis.stability.hand_slopes import hand_slopes
from hapticlink.analysis.stability.modes import modes
from hapticlink.analysis.stability.poses import in_own_hand
from hapticlink.orchestrator.base.signal_names import HAND
from studies.mismatch.cases import LINKAGES, Case
from studies.run_modes import fit_modes

OFF, FAR = 1e-9, 1e-3
"""From the start to the hand's target, in x and y (m)."""
SECONDS = 8.0
LARGE, SMALL = 1e-6, 1e-11
"""Velocities (m/s) above which a motion is no longer far below 10 um, so that `reaction` finds a
stiffness, and below which it is rounding."""
SAME = 0.01
"""Difference of growth rates, relative to the larger one or to 1 1/s, that is none."""
GAINS = {"medium": 100.0, "firm": 400.0}
TOPOLOGY = 200.0, 50.0
"""Stiffness and damping of the topology controller, its defaults."""
BESIDE = (0.95, 1.05)
"""Factors on a margin, which is searched to 2 % of its logarithm."""


@dataclass(frozen=True)
class Cell:
    """A linkage in a hand of `hand` (N/m); `late`: the computing time, in frames."""

    linkage: str
    gains: str
    rate: int
    hand: float
    late: float = 0.0
    off: float = OFF
    turned: float = 0.0
    """From the start to the hand's target, in angle (rad)."""
    stiffer: float = 1.0
    """The factor on the stiffnesses of the controller, dampings by its root."""

    @property
    def scene(self) -> str:
        return Case(self.linkage, "spring", False, 1).scene

    @property
    def options(self) -> dict[str, Any]:
        x, y, angle = self.start
        k, s = self.hand, self.stiffer
        K = s * GAINS[self.gains]
        B = 2.0 * K**0.5
        return {
            "hold": "model",
            "downsampling": "model",
            "directions_from": "mechanism",
            "mechanism_at": "graphics",
            "sensing": "ideal",
            "controller.bias": "full",
            "controller.teleoperation.stiffness": [K, K, K / 1000],
            "controller.teleoperation.damping": [B, B, B / 1000],
            "controller.topology.stiffness": TOPOLOGY[0] * s,
            "controller.topology.damping": TOPOLOGY[1] * s**0.5,
            "graphics.rate": self.rate,
            "computing_time": self.late / self.rate,
            "hand": {
                "type": "spring",
                "stiffness": [k, k, k / 500],
                "damping": [k / 50, k / 50, k / 20000],
                "target": [[0.0, x + self.off, y - self.off, angle + self.turned]],
            },
        }

    @cached_property
    def start(self) -> list[float]:
        """The pose of the operational point at the start."""
        r = hl.run(self.scene, {"duration": 0.01}, figures=False)
        pose: list[float] = r["virtual_mechanism.x"][0].tolist()
        return pose


def cells() -> Iterator[Cell]:
    """20 cells, of frames of whole haptic periods, so that a period of the map is a frame. The
    handle takes part in their leading mode: of another one its velocities tell nothing."""
    settings = (
        ("medium", 16, 300.0, 0.0),
        ("medium", 8, 100.0, 0.0),
        ("firm", 16, 500.0, 0.0),
        ("firm", 32, 100.0, 0.0),
        ("firm", 16, 500.0, 0.5),
    )
    for linkage, setting in product(LINKAGES, settings):
        yield Cell(linkage, *setting)


def of_map(cell: Cell) -> tuple[float, float]:
    """The growth rate (1/s) of the leading mode at the equilibrium, and its period P (s)."""
    with in_own_hand(hl.scene(cell.scene, cell.options)) as (place, hand):
        period = place.period({})
        if hand is not None:
            period = period.held({HAND: hand_slopes(hand, place.T)})
        leading = modes(period.linear, place.map.period)[0]
        return leading.growth, place.map.period


def of_run(cell: Cell, P: float) -> float:
    """The growth rate (1/s) in periods of P (s), the larger one of two runs: straight motions alone
    may leave out a mode of turning, and both together hide one that grows at nearly the rate of
    another."""
    return max(_of_one_run(cell, P), _of_one_run(replace(cell, turned=OFF), P))


def _of_one_run(cell: Cell, P: float) -> float:
    r = hl.run(cell.scene, cell.options | {"duration": SECONDS}, figures=False)
    v = r["haptic_device.v"][1:]
    steps = round(P * 512)
    snapshots = v[: len(v) // steps * steps].reshape(-1, steps * v.shape[1])
    size = np.abs(snapshots).max(axis=1)
    outside = np.flatnonzero((size > LARGE) | (size < SMALL))
    end = outside[0] if len(outside) else len(size)
    begin = end // 4  # what decays at once is left out
    return float(np.log(np.abs(fit_modes(snapshots[begin:end])[0]).max()) / P)


def left_of(cell: Cell, hold: str) -> float:
    """What is left (um) of the motion from FAR with `hold` of F_hand."""
    options = cell.options | {"duration": SECONDS, "holds": {"virtual_mechanism.F_hand": hold}}
    r = hl.run(cell.scene, options, figures=False)
    if r.run["end"]["reason"] != "duration":
        return math.inf
    handle = r["haptic_device.x"][:, :2]
    return 1e6 * float(np.ptp(handle[len(handle) * 3 // 4 :], axis=0).max())


LEFT = {"left_of_1_mm_um": "reaction", "left_with_half_lead_um": "half-lead"}


def both_rates(cell: Cell) -> tuple[float, float]:
    """The growth rates (1/s) by the map and of a run."""
    told, P = of_map(cell)
    return told, of_run(cell, P)


def margin_of(cell: Cell) -> float:
    """The factor on the stiffnesses up to which `stability` calls a stable cell stable."""
    found = hl.equilibrium_stability(cell.scene, cell.options)
    assert isinstance(found, hl.Stability)
    assert found.margin.stiffness
    return found.margin.stiffness


def agree(told: float, found: float) -> bool:
    """Whether two growth rates are the same."""
    return abs(told - found) <= SAME * max(1.0, abs(told), abs(found))


HEADER = (
    "linkage", "gains", "hz", "hand_n_per_m", "computing_time_frames", "map", "run", "margin",
    "map_below_margin", "run_below_margin", "map_above_margin", "run_above_margin", "same",
    "left_of_1_mm_um", "left_with_half_lead_um",
)  # fmt: skip


def main(folder: Path) -> None:
    """Writes the table."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "growth.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, HEADER, lineterminator="\n")
        table.writeheader()
        for cell in cells():
            rates = [both_rates(cell)]
            row = dict(zip(HEADER[:5], astuple(cell), strict=False))
            if not cell.late:
                if rates[0][0] < 0.0:
                    row["margin"] = margin = margin_of(cell)
                    rates += [both_rates(replace(cell, stiffer=margin * f)) for f in BESIDE]
                far = replace(cell, off=FAR)
                row |= {key: left_of(far, hold) for key, hold in LEFT.items()}
            found = [f"{rate:.4g}" for both in rates for rate in both]
            row |= zip((*HEADER[5:7], *HEADER[8:12]), found, strict=False)
            row["same"] = all(agree(*both) for both in rates)
            row = {k: f"{v:.3g}" if isinstance(v, float) else v for k, v in row.items()}
            table.writerow(row)
            print(*row.values(), flush=True)
            file.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else "results/model"))
