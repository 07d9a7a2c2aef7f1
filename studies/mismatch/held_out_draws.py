"""The section on the draws that no choice has seen."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import fill

import numpy as np

from studies.mismatch.design import CONTINUOUS, DIRECT, MOBILITY
from studies.mismatch.figures import short
from studies.mismatch.findings import COMPENSATION, Found, errors, named
from studies.mismatch.measure import stable
from studies.mismatch.method_choice import cells, margin, metric, within
from studies.mismatch.methods import BIAS, COLUMNS, KEPT_APART, Method

HEAD = (
    "| mechanism, Coriolis compensation, rate (Hz) | method | within the limits | `zoh` | error "
    "(mm) | relative to `zoh` | margin on the slider-crank (1/s) |\n|---|---|---|---|---|---|---|\n"
)


def section(found: Found) -> Iterator[str]:
    """What the advice is worth where it was not looked for."""
    yield "## Kept apart: another linkage, another hand, another rate"
    by_cell = cells(r for r in found.tried if r["arrangement"] != CONTINUOUS)
    lines, kept, sound, of, worse, ratios, beyond = [], 0, 0, 0, [], [], 0
    better = [0, 0, 0]  # draws within the limits with another hold, with zoh, and in all
    for arrangement, bias, rate in (
        (a, b, r) for a in (DIRECT, MOBILITY) for b in BIAS for r in (*COLUMNS, KEPT_APART)
    ):
        cell = (arrangement, bias, rate)
        method, advised = found.methods[cell], _advised(found, cell)
        rows, what = by_cell[cell][method], metric(arrangement)
        by_zoh = by_cell[cell][Method("zoh", method.gains)]
        good = [r for r in rows.values() if within(r)]
        both = [c for c in rows if stable(rows[c]) and stable(by_zoh[c])]
        ratio = [rows[c][what] / max(by_zoh[c][what], 1e-9) for c in both]
        if advised:
            kept, of = kept + len(good), of + len(rows)
            sound += sum(map(stable, rows.values()))
        if arrangement == DIRECT and method.hold != "zoh" and ratio:
            ratios.append(float(np.median(ratio)))
            beyond += bool(np.quantile(ratio, 0.75) < 1.0)
            worse += [f"{rate} Hz ({COMPENSATION[bias][22:]})"] * (ratios[-1] > 1.0)
            better[0] += len(good)
            better[1] += sum(map(within, by_zoh.values()))
            better[2] += len(rows)
        error = errors([r for r in rows.values() if stable(r)])
        where = "512 Hz" if arrangement == MOBILITY else "graphics"
        lines.append(
            f"| {where}, {COMPENSATION[bias][22:]}, {rate} | "
            f"{named(method)}{'' if advised else ' (not advised)'} | {len(good)} of {len(rows)} | "
            f"{sum(map(within, by_zoh.values()))} of {len(by_zoh)} | {error} | "
            f"{short(float(np.median(ratio))) if ratio and method.hold != 'zoh' else '-'} | "
            f"{short(margin(found.margins_apart, arrangement, method, rate)) or '-'} |"
        )
    text = (
        "The slider-crank, a massless spring hand of 200 N/m, and the rate of 24 Hz, whose frames "
        "end between ticks and which takes the row of 20 Hz, were in no choice. With the advised "
        f"methods {sound} of {of} of these runs are stable, and {kept} of {of} keep both limits. "
        "Where the tables have another hold than `zoh` for a mechanism at the graphics rate, it "
        f"keeps the limits in {better[0]} of {better[2]} draws, `zoh` with the same gains in "
        f"{better[1]}; its error is smaller than that of `zoh` (median within draws) in "
        f"{len(ratios) - len(worse)} of {len(ratios)} cells"
        f"{'; not at ' + ', '.join(worse) if worse else ''}; beyond the spread, in more than three "
        f"quarters of the draws, in {beyond}."
    )
    yield fill(text, 108, break_on_hyphens=False)
    yield HEAD + "\n".join(lines)


def _advised(found: Found, cell: tuple[str, str, str]) -> bool:
    arrangement, bias, rate = cell
    at = "20" if rate == KEPT_APART else rate
    return found.advice[arrangement, bias, at].method is not None
