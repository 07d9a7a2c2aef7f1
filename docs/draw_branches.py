"""Draws a run and its branches, which go on from one state, to docs/figures/branches.png:

python docs/draw_branches.py
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from matplotlib.figure import Figure

import hapticlink as hl

PATH = Path(__file__).with_name("figures") / "branches.png"
SAVED, END = 0.6, 1.2
"""s."""
BRANCHES: dict[str, dict[str, Any]] = {
    "graphics at 11 Hz": {"at": [{"time": SAVED, "set": {"graphics.rate": 11}}]},
    "a softer coupling": {"controller.teleoperation.stiffness": [40.0, 40.0, 0.2]},
}
COLOURS = ["#555555", "#cc3311", "#0077bb"]


def figure(folder: Path) -> Figure:
    first = hl.run("closed-loop-direct", {"duration": END}, out=folder, figures=False, save=[SAVED])
    state = folder / f"at-{SAVED:g}.state"
    runs = {"the run": first}
    runs |= {name: hl.run(state, options) for name, options in BRANCHES.items()}
    drawn = Figure(figsize=(9, 2.6), layout="constrained")
    axes = drawn.add_subplot()
    for colour, (name, run) in zip(COLOURS, runs.items(), strict=True):
        error = run.tracking()
        axes.plot(error.time_s, error.distance_mm, colour, label=name, linewidth=1.2)
    axes.axvline(SAVED, color="#999999", linestyle=":")
    axes.set(xlabel="time (s)", ylabel="distance (mm)", ylim=(0.0, None))
    axes.set_title("Handle and operational point: one state, three runs", fontsize="medium")
    axes.legend(fontsize="small", loc="upper left")
    return drawn


if __name__ == "__main__":
    with TemporaryDirectory() as room:
        drawing = figure(Path(room) / "run")
    drawing.savefig(PATH, dpi=90, metadata={"Software": None})  # the same bytes every time
    print(PATH)
