"""Hard scenes at the edge of stability and beyond it, each with what has to become of it.

The catalogue is data, stress.toml: a scene, what is set in it, and the expected outcome,

    stable    it runs to its end (status 0), and the mechanism's energy never exceeds that at the
              start by more than `energy` (J)
    warned    it runs to its end with more, and the warnings of run.json have the text `says`
    stopped   it meets its own `stop_when` (status 0), such as at the end of the workspace
    ended     it ends itself by a fault with the text `says` in run.json (status 1)
    refused   the input is refused with the text `says` before anything runs (status 2)

and, where there is one, the verdict of the lifted map (`hapticlink stability`). The remaining
outcome, `grew`, is what none may have: an end with more energy than the bound and no warning.
"""

from __future__ import annotations

import csv
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

import hapticlink as hl
from benchmarks.page import Progress, table
from hapticlink.analysis.stability.scene_variants import SceneVariants
from hapticlink.orchestrator.base.errors import Fault, InputFault

CATALOGUE = Path(__file__).parent / "stress.toml"
Outcome = Literal["stable", "warned", "stopped", "ended", "refused", "grew"]


@dataclass(frozen=True, kw_only=True)
class Case:
    """An entry of the catalogue."""

    name: str
    kind: str
    scene: str
    why: str
    expect: Outcome
    set: dict[str, Any] = field(default_factory=dict)
    energy: float = 0.0
    says: str = ""
    map: str = ""
    quick: bool = False


@dataclass(frozen=True, kw_only=True)
class Made:
    """What became of a case: end is the reason and time (s) of the end with the messages of a fault
    and warnings, or that of a refusal; rise the largest energy above that at the start (J); map the
    verdict of the lifted map."""

    outcome: Outcome
    status: int
    end: str
    rise: float
    map: str

    def wrong(self, case: Case) -> str:
        """What is not as expected, "" if nothing is."""
        found = []
        if self.outcome != case.expect:
            found.append(f"{self.outcome}, expected {case.expect}")
        if case.says not in self.end:
            found.append(f"does not say {case.says!r}: {self.end}")
        if case.map != self.map:
            found.append(f"the map says {self.map}, expected {case.map}")
        return "; ".join(found)


COLUMNS = ("case", "kind", "expected", "outcome", "status", "rise_J", "bound_J", "map", "end")
LONG = 160
"""Characters of an end that the page quotes."""


def cases() -> list[Case]:
    """The catalogue."""
    with CATALOGUE.open("rb") as file:
        return [Case(**entry) for entry in tomllib.load(file)["case"]]


def make(case: Case) -> Made:
    """Runs a case."""
    verdict = ""
    if case.map:
        with SceneVariants(hl.scene(case.scene, case.set)) as variants:
            verdict = variants.judge(()).verdict
    try:
        run = hl.run(case.scene, case.set, figures=False)
    except InputFault as fault:
        return Made(
            outcome="refused", status=fault.exit_status, end=str(fault), rise=0, map=verdict
        )
    rise, record = risen(run), run.record
    messages = [record.fault.message] if record.fault else record.warnings or []
    outcome: Outcome = "stable" if rise <= case.energy else "warned" if messages else "grew"
    if run.fault:
        outcome = "ended"
    elif record.end.reason != "duration":
        outcome = "stopped"
    end = "; ".join([f"{record.end.reason} at {record.end.time:.4g} s", *messages])
    status = Fault.exit_status if run.fault else 0
    return Made(outcome=outcome, status=status, end=end, rise=rise, map=verdict)


def risen(run: hl.Run) -> float:
    """The largest energy of the mechanism above that at its start, J."""
    name = "virtual_mechanism.energy"
    for rows in run.tables.values():
        if name in rows.columns and len(rows[name]):
            energy = rows[name]
            return float(np.nanmax(energy) - energy[0])
    return 0.0


def bench(out: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes stress.csv to `out`."""
    chosen = [case for case in cases() if case.quick or not quick]
    found: dict[str, Made] = {}
    for i, case in enumerate(chosen):
        progress(f"stress: {case.name}", i, len(chosen))
        found[case.name] = make(case)
    with (out / "stress.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for case in chosen:
            m, bound = found[case.name], f"{case.energy:g}"
            row = (case.name, case.kind, case.expect, m.outcome, m.status, f"{m.rise:.3g}", bound)
            writer.writerow((*row, m.map, m.end))
    return page(chosen, found, command)


def page(chosen: Sequence[Case], found: Mapping[str, Made], command: str) -> str:
    wrong = {c.name: why for c in chosen if (why := found[c.name].wrong(c))}
    counts = Counter(case.expect for case in chosen)
    judged = sum(bool(case.map) for case in chosen)
    finding = (
        f"All {len(chosen)} hard scenes end as they have to: {counts['stable']} within their "
        f"energy bound, {counts['warned']} beyond it with a warning, {counts['stopped']} at "
        f"the end of the workspace, {counts['ended']} by a fault that names the cause (status 1), "
        f"{counts['refused']} refused before they run (status 2). None grows without a word, and "
        f"the lifted map is right on the {judged} that it was asked about."
    )
    if wrong:
        faults = (f"- {name}: {why}" for name, why in wrong.items())
        finding = "\n".join(
            [f"{len(wrong)} of {len(chosen)} hard scenes do not end as they have to:\n", *faults]
        )
    lines = [
        "# Hard scenes\n",
        f"{finding}\n",
        f"Generated by `{command}` from the catalogue [benchmarks/stress.toml]"
        "(../../benchmarks/stress.toml); numbers in [stress.csv](stress.csv).",
        "The rise is the largest energy of the mechanism above that at its start.\n",
    ]
    rows = []
    for case in chosen:
        made = found[case.name]
        end = made.end if len(made.end) < LONG else f"{made.end[:LONG]}..."
        bounded = case.expect in ("stable", "warned")
        rise, bound = (f"{made.rise:.3g}", f"{case.energy:g}") if bounded else ("", "")
        rows.append((case.name, case.why, case.expect, end, rise, bound, case.map))
    heads = "scene | why it is hard | expected | end | rise (J) | bound (J) | map"
    return "\n".join([*lines, *table(heads, "llllrrl", rows)]) + "\n"
