"""Draws when FMUs of several rates are stepped, from the timeline of a scene, to
docs/figures/rates.png:

python docs/draw_rates.py
"""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

import hapticlink as hl
from hapticlink.orchestrator.system.timeline import timeline

PATH = Path(__file__).with_name("figures") / "rates.png"
SHOWN = 0.12
"""s."""
RATES: dict[str, dict[str, Any]] = {
    "rate = 30": {"graphics.rate": 30},
    "rate = 30, phase = 0.01": {"graphics.rate": 30, "graphics.phase": 0.01},
    "rate = { min = 20, max = 60, seed = 1 }": {"graphics.rate": {"min": 20, "max": 60, "seed": 1}},
    "rate = [0.017, 0.034, 0.1, 0.13]": {"graphics.rate": [0.017, 0.034, 0.1, 0.13]},
}


def points(options: dict[str, Any], clock: str) -> list[float]:
    """The communication points (ms) of a clock of closed-loop, up to SHOWN."""
    scene = hl.scene("closed-loop", {"duration": SHOWN, **options})
    time = timeline(scene)
    name = time.of["virtual_environment"] if clock == "graphics" else clock
    seconds = (time.seconds(tick) for tick in time.clock(name).starts)
    return [t * 1e3 for t in takewhile(lambda t: t <= SHOWN, seconds)]


def figure() -> Figure:
    drawn = Figure(figsize=(9, 2.6), layout="constrained")
    axes = drawn.add_subplot()
    rows = [points(options, "graphics") for options in RATES.values()]
    axes.eventplot(
        [*reversed(rows), points({}, "haptics")], linelengths=0.7, linewidths=[2.5] * 4 + [1.0],
        colors=["#ee7733"] * 4 + ["#0077bb"],
    )  # fmt: skip
    labels = [*(f"graphics.{text}" for text in reversed(RATES)), "haptics.rate = 512"]
    axes.set_yticks(range(len(labels)), labels, fontsize="small")
    axes.set_xlabel("time (ms)")
    axes.set_title("Communication points: the ends of steps", fontsize="medium")
    return drawn


if __name__ == "__main__":
    figure().savefig(PATH, dpi=90, metadata={"Software": None})  # the same bytes every time
    print(PATH)
