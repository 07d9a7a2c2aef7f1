"""Energy balance at the end of a run: detects divergence of the integration and of the loop.

The mechanism: E(t) - E(0) <= W, the work of the wrenches held on its inputs. The error of a working
integrator stays far below the energies involved; a gain of more than these means divergence.

The loop: sum of generated <= work of the hands as ideal sources + E(0) - E(t), what the mechanism
has given back of what it had stored and of its motion. Sampling and holding that generate more
energy than was ever put in indicate an unstable loop. Where drives, or a hand on a board, put in
energy that is not known, it is not judged.
"""

from __future__ import annotations

from collections.abc import Mapping

from hapticlink.orchestrator.base.errors import Diverged
from hapticlink.orchestrator.base.signal_names import MECHANISM, PASS_ON
from hapticlink.orchestrator.results.run_record import Energy
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.system import System

LEAST = 1e-6
"""Energy (J) below which no gain is reported: 0.1 kg at 4 mm/s."""


class Balance:
    """Energy balance of the mechanism, checked where only wrenches put energy into it. begun: its
    energy at t = 0 (J)."""

    def __init__(self, signals: SignalVector) -> None:
        self._system, self._values = signals.system, signals.values
        mechanism = self._system.fmu.get(MECHANISM)
        known = mechanism and any(s.name == "energy" for s in mechanism.description.outputs)
        self._place = signals.scalar(MECHANISM, "energy") if known else None
        self.begun = 0.0

    def start(self) -> None:
        self.begun = self._energy()

    def _energy(self) -> float:
        return 0.0 if self._place is None else float(self._values[self._place])

    def judge(self, booked: Mapping[str, Energy], time: float) -> Diverged | None:
        """The fault of a mechanism that has gained more energy by `time` (s) than the connections
        put in; None where the balance holds."""
        in_play = self._system.energy.in_play
        if self._place is None or in_play is None:
            return None
        work = [e.held for n, e in booked.items() if self._system.connection[n].target == MECHANISM]
        gained = self._energy() - self.begun - sum(work)
        scale = abs(self.begun) + sum(map(abs, work)) + in_play + LEAST
        if gained <= scale:
            return None
        what = f"has {gained:.3g} J more than it had at the start and was given: the run has"
        remedy = "diverged (take a higher rate, mechanism.substeps, or another integrator)"
        return Diverged(MECHANISM, f"{what} {remedy}", time, repeatable=True)

    def unstable(self, booked: Mapping[str, Energy]) -> str:
        """A message if sampling and holding have generated more energy than hands and mechanism put
        in, else ""."""
        generated, by_hands = sum_energies(self._system, booked)
        put_in = by_hands + max(self.begun - self._energy(), 0.0)
        held = any(fmu.driver for fmu in self._system.fmus)  # by a hand whose work nobody knows
        if held or self._system.energy.driven or generated <= put_in + LEAST:
            return ""
        generation = f"sampling and holding generated {generated:.3g} J, where "
        if put_in:
            return f"{generation}{put_in:.3g} J were put in"
        return f"{generation}neither hands nor mechanism put in any on the whole"


def sum_energies(system: System, booked: Mapping[str, Energy]) -> tuple[float, float]:
    """The energies (J) that sampling and holding have generated, and that hands and mechanism have
    put in. What a controller passes on was not put in by it."""
    source = {name: system.block(system.connection[name].source) for name in booked}
    put_in = sum(max(e.ideal, 0.0) for n, e in booked.items() if source[n] not in PASS_ON)
    return sum(e.generated for e in booked.values()), put_in
