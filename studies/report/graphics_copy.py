"""Section 4.2.2: the graphics copy pulled at its operational point, compared with the exact copy,
which cannot fold."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hapticlink.analysis.findings.tracking import count_folded, tracking
from studies import draw
from studies.report.report_page import Entry, Runs, command

PULLED = "graphics.sync=operational"


def entries(runs: Runs, folder: Path) -> Iterator[Entry]:
    figure, axes = draw.panels(2)
    found = {}
    for axis, bias in zip(axes, ("none", "full"), strict=True):
        for label, options, colour in (
            ("exact", (), draw.BLUE),
            ("pulled (report)", (PULLED,), draw.ORANGE),
        ):
            results = runs("closed-loop-ideal", *options, f"controller.bias={bias}")
            time, gap = tracking(results)
            found[bias, label] = (*count_folded(results), gap.max())
            axis.semilogy(time, np.maximum(gap, 1e-4), color=colour, label=label)
        graphics = results.graphics  # of the pulled copy
        off = graphics["time"][graphics["virtual_environment.branch_ok"] == 0]
        axis.plot(off, np.full(len(off), 2e-4), "|", color=draw.GREY, label="pulled copy folded")
        count, of, _ = found[bias, "pulled (report)"]
        title = f"bias = {bias}: folded in {count} of {of} frames"
        axis.set(xlabel="time (s)", ylabel="distance |x_S - x_D| (mm)", title=title)
    axes[0].legend(fontsize="small")
    counts = [
        f"bias {bias}: {count} of {of} frames folded and {gap:.2g} mm pulled, "
        f"{found[bias, 'exact'][0]} folded and {found[bias, 'exact'][2]:.2g} mm exact"
        for (bias, label), (count, of, gap) in found.items()
        if label != "exact"
    ]
    yield Entry(
        "Section 4.2.2, synchronisation of the graphics block",
        draw.save(figure, folder, "graphics_copy.png"),
        "a PD controller on the operational point keeps the graphics copy with the mechanism",
        "not for links 3 and 4, which the pose of the operational point does not determine: the "
        "copy folds to the other assembly, and the device gets Lambda^-1 and the constrained "
        f"directions of that one. {'; '.join(counts)}. All other figures use the exact copy",
        command("closed-loop-ideal", PULLED),
    )
