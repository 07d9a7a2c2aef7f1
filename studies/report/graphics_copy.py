"""Section 4.2.2: the graphics copy pulled at its operational point, compared with the exact copy,
which cannot fold."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hapticlink.analysis.findings.tracking import count_folded, tracking
from studies import draw
from studies.report.report_page import Entry, Runs, premises
from studies.report.systems import IDEAL_6, ON, STATED_6

PULLED = "graphics.sync=operational"


def entries(runs: Runs, folder: Path) -> Iterator[Entry]:
    systems = (STATED_6, IDEAL_6)
    figure, axes = draw.panels(2)
    counts, folded, rests = [], [], []
    for axis, system in zip(axes, systems, strict=True):
        exact, pulled = system.run(runs, ON), system.run(runs, ON, PULLED)
        for results, label, colour in (
            (exact, "exact", draw.BLUE),
            (pulled, "pulled (report)", draw.ORANGE),
        ):
            time, gap = tracking(results)
            axis.semilogy(time, np.maximum(gap, 1e-4), color=colour, label=label)
        graphics = pulled.graphics
        off = graphics["time"][graphics["virtual_environment.branch_ok"] == 0]
        axis.plot(off, np.full(len(off), 2e-4), "|", color=draw.GREY, label="pulled copy folded")
        count, of = count_folded(pulled)
        folded.append(count)
        axis.set_title(f"{system.name}: folded in {count} of {of} frames", fontsize="medium")
        axis.set(xlabel="time (s)", ylabel="distance |x_S - x_D| (mm)")
        counts.append(
            f"{system.name}: {count} of {of} frames folded and {tracking(pulled)[1].max():.2g} mm "
            f"pulled, {count_folded(exact)[0]} folded and {tracking(exact)[1].max():.2g} mm exact"
        )
        rests += [premises(f"{system.name}, pulled", pulled)]
    axes[0].legend(fontsize="small")
    yield Entry(
        "Section 4.2.2, synchronisation of the graphics block",
        f"pulled at its operational point the copy folds in {folded[0]} of {of} frames",
        draw.save(figure, folder, "graphics_copy.png"),
        "a PD controller on the operational point keeps the graphics copy with the mechanism",
        "not for links 3 and 4, which the pose of the operational point does not determine: the "
        "copy folds to the other assembly, and the device gets Lambda^-1 and the constrained "
        f"directions of that one. {'; '.join(counts)}. The figures of chapter 6 use the exact "
        "copy, those of section B.6 as stated the pulled one",
        rests,
        "; ".join(system.command(ON, PULLED) for system in systems),
    )
