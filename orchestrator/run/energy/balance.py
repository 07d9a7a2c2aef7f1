"""Whether a run has more energy than was put into it, at its end.

The mechanism: E(t) - E(0) <= W, the work of the wrenches that it got (as held). What the method of
integration errs stays far below what is there to err about; beyond that size it makes energy up.

The loop: sum of made <= sum of what hands put in, as ideal sources. Sampling and holding that make
more than was ever put in have made the loop unstable.
"""

from __future__ import annotations

from collections.abc import Mapping

from hapticlink.orchestrator.base.faults import Diverged
from hapticlink.orchestrator.run.energy.meter import Energy
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.haptic_loop import CONTROLLER, MECHANISM
from hapticlink.orchestrator.system.system import System

LEAST = 1e-6
"""J below which nothing is judged: 0.1 kg at 4 mm/s."""


class Balance:
    """The account of the mechanism's energy, where nothing but wrenches puts any in."""

    def __init__(self, system: System, signals: SignalVector) -> None:
        self._system, self._values = system, signals.values
        judged = system.energy_in_play is not None and MECHANISM in system.fmu
        self._place = signals.scalar(MECHANISM, "energy") if judged else None
        self._start = 0.0

    def start(self) -> None:
        """The mechanism stands at its start."""
        if self._place is not None:
            self._start = float(self._values[self._place])

    def judge(self, booked: Mapping[str, Energy], time: float) -> Diverged | None:
        """Why the energy at `time` (s) cannot be, after what the connections have carried."""
        if self._place is None:
            return None
        assert self._system.energy_in_play is not None
        work = [e.held for n, e in booked.items() if self._system.connection[n].target == MECHANISM]
        gained = float(self._values[self._place]) - self._start - sum(work)
        size = abs(self._start) + sum(map(abs, work)) + self._system.energy_in_play + LEAST
        if gained <= size:
            return None
        what = f"has {gained:.3g} J more than it had at the start and was given: the run has"
        remedy = "diverged (take a higher rate, mechanism.substeps, or another integrator)"
        return Diverged(MECHANISM, f"{what} {remedy}", time, repeatable=True)


def unstable(booked: Mapping[str, Energy]) -> str:
    """That sampling and holding have made more energy than was put in; "" where they have not."""
    made = sum(e.made for e in booked.values())
    sources = (e for name, e in booked.items() if not name.startswith(f"{CONTROLLER}."))
    put_in = sum(max(e.ideal, 0.0) for e in sources)
    if made <= put_in + LEAST:
        return ""
    return f"sampling and holding made {made:.3g} J, where {put_in:.3g} J were put in"
