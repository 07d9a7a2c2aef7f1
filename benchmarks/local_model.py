"""The local model (B.15) against the mechanism's own matrices: cost of a step and error of the tip.

The five-bar of Table 6.1 alone under the wrench of chapter 6, with the matrices of a copy that
follows every joint coordinate. Cost: instructions of a step, and the least time of 20 repetitions
of 2000 steps.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks import mechanisms
from benchmarks.our_mechanism import in_place
from benchmarks.page import Progress, table
from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism
from hapticlink.components.component import Component
from hapticlink.components.specs.linkage import Mechanism
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.experiment import simulate
from studies import draw

STEP = 1 / 512
HELD = ("local_model=true", "mechanism.stabilization=baumgarte")


def microseconds(block: Component) -> float:
    """Least mean time of a step, on preallocated memory."""
    u, p = np.array(block.start_inputs), np.array(block.start_parameters)
    x = np.array(block.initialize(u, p)).ravel()
    after, arguments = np.empty_like(x), (x, u, p, np.zeros(1), np.array([STEP]))
    _buffer, trigger = in_place(block.step, arguments, after)
    times = []
    for _ in range(20):
        start = perf_counter()
        for _ in range(2000):
            trigger()
        times.append((perf_counter() - start) / 2000)
    return min(times) * 1e6


def costs() -> Iterator[str]:
    linkage = mechanisms.five_bar()
    rows = []
    for name, frame, stabilization in (
        ("own", None, "projection"),
        ("own", None, "baumgarte"),
        ("held", 1 / 60, "baumgarte"),
    ):
        for integrator in ("semi-implicit-euler", "rk4"):
            spec = Mechanism(integrator=integrator, stabilization=stabilization)  # type: ignore[arg-type]
            block = virtual_mechanism(linkage, spec, step_s=STEP, frame_s=frame)
            spent = f"{microseconds(block):.1f}"
            rows.append((name, integrator, stabilization, block.step.n_instructions(), spent))
    heads = "matrices | integrator | stabilisation | instructions | us a step"
    return table(heads, "lllll", rows)


def tip(folder: Path, *options: str) -> tuple[np.ndarray, float]:
    """(path of the operational point, largest closure error), m."""
    found = simulate("five-bar", folder, options).results.haptics
    way = np.column_stack([found[f"virtual_mechanism.x[{i}]"] for i in (1, 2)])
    return way, float(found["virtual_mechanism.closure_error"].max())


Gaps = dict[tuple[str, int], tuple[np.ndarray, float]]


def gaps(rates: tuple[int, ...], progress: Progress) -> Gaps:
    """By integrator and rate of the frames: the distance (mm) of the operational point from that of
    the mechanism with its own matrices at each tick of 1 s, and the largest gap of the loop (m)."""
    cases = [(i, r) for i in ("semi-implicit-euler", "rk4") for r in rates]
    found = {}
    with temporary_folders.temporary_folder() as room:
        own, _ = tip(room / "own", "duration=1.0")
        for k, (integrator, rate) in enumerate(cases):
            progress(f"local model: {integrator} at {rate} Hz", k, len(cases))
            options = [*HELD, "duration=1.0", f"mechanism.integrator={integrator}"]
            options.append(f"graphics={{rate={rate}, sync='joint'}}")
            held, opened = tip(room / f"{k}", *options)
            found[integrator, rate] = np.linalg.norm(held - own[: len(held)], axis=1) * 1e3, opened
    return found


def errors(found: Gaps) -> Iterator[str]:
    rows = []
    for (integrator, rate), (gap, opened) in found.items():
        ticks = [round(t * 512) for t in (0.25, 0.5, 1.0)]
        at = [f"{gap[: k + 1].max():.3g} mm" if k < len(gap) else "diverged" for k in ticks]
        rows.append((integrator, f"{rate} Hz", *at, f"{opened * 1e3:.3g} mm"))
    return table("integrator | frames | .25 s | .5 s | 1 s | closure, 1 s", "llllll", rows)


def figure(folder: Path, found: Gaps) -> None:
    """The distance over time, by rate, with semi-implicit Euler."""
    drawn, (axes,) = draw.panels(1, width=6.4)
    for (integrator, rate), (gap, _) in found.items():
        if integrator == "semi-implicit-euler":
            axes.semilogy(np.arange(1, len(gap)) / 512, gap[1:], label=f"frames at {rate} Hz")
    axes.set(xlabel="time (s)", ylabel="distance from the own matrices (mm)", ylim=(1e-4, None))
    axes.set_title(
        "From 30 Hz on the error is that of the Coriolis terms, which are left out",
        fontsize="medium", wrap=True,
    )  # fmt: skip
    axes.legend(fontsize="small")
    draw.save(drawn, folder, "error.png")


def bench(out: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes error.png to `out`."""
    progress("local model: cost of a step", 0, 1)
    cost, found = list(costs()), gaps((30, 60) if quick else (10, 30, 60, 512), progress)
    ends = [gap[512] for gap, _ in found.values() if len(gap) > 512]
    lost = sorted({f"{rate} Hz" for (_, rate), (gap, _) in found.items() if len(gap) <= 512})
    figure(out, found)
    page = [
        "# The local model of interaction\n",
        "With matrices held from the graphics rate the operational point is "
        f"{min(ends):.0f} to {max(ends):.0f} mm off after 1 s;",
        "the older the matrices, the further the loop opens"
        + (f": at {', '.join(lost)} the run diverges.\n" if lost else ".\n"),
        "![Error over time for frames at several rates](error.png)\n",
        f"Made by `{command}`. Five-bar of Table 6.1 under the wrench of chapter 6, no device;",
        "times of one machine, compare them within the table. What is held, and why:",
        "[the local model](../../docs/local-model.md).\n",
        "## Error\n",
        "Largest distance of the operational point from the mechanism with its own matrices (rk4",
        "and projection), and the largest gap of the loop in 1 s.\n",
        *errors(found),
        "\n## Cost of a step at 512 Hz\n",
        *cost,
    ]
    return "\n".join(page) + "\n"
