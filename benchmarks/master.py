"""Masters side by side: what a macro step of a ring of FMUs costs beside the FMUs themselves.

A ring of n native FMUs that pass on their inputs, y = u/2 + 1, each with k reals. Time per macro
step: (t(5 N) - t(N)) / 4 N, so that start-up cancels, the least of several interleaved rounds.
"""

from __future__ import annotations

import os
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from time import thread_time

from benchmarks.peers import bare_scene, masters
from benchmarks.peers.masters import Ring
from hapticlink.components.blocks import BLOCKS
from hapticlink.components.component import Block, Component, Variable
from hapticlink.orchestrator.api.files import export
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.run import event_loop
from hapticlink.orchestrator.run.compiled.library import CHOICE

SIZES = ((2, 3), (4, 3), (16, 3), (64, 3), (4, 1), (4, 16), (4, 64))
"""FMUs and signals."""
QUICK = ((4, 3), (64, 3))
ROUNDS = 7
CALLS = 40_000
"""Steps of FMUs in the shorter of two runs."""
LOOP = "closed-loop"
DURATIONS = (3, 15)
"""Of its two runs (s)."""
OURS = "hapticlink"
PYTHON = "hapticlink, loop in Python"
Row = dict[str, float]


def pass_on(signals: int = 3) -> Component:
    """y = u/2 + 1."""
    block = Block(inputs=[Variable("u", (signals,), "m")], outputs=[Variable("y", (signals,), "m")])
    output = {"y": block.u["u"] / 2 + 1}
    return block.component("pass_on", "passes on", "continuous", initial={}, step={}, output=output)


def scene(n: int, signals: int) -> str:
    """The scene of a ring."""
    fmu = '[[fmu]]\nname = "f{0}"\nblock = "pass-on"\nsettings = {{ signals = {1} }}\n'
    wire = '[[connection]]\nfrom = "f{0}.y"\nto = "f{1}.u"\n'
    head = (
        'title = "ring"\nduration = 1.0\ncoupling = "jacobi"\nhaptics.rate = 512\n'
        'packaging = "native"\n'
    )
    fmus = "".join(fmu.format(i, signals) for i in range(n))
    return head + fmus + "".join(wire.format(i, (i + 1) % n) for i in range(n))


def ours(path: Path, out: Path, steps: int, choice: str) -> float:
    """Seconds of our loop, recorded."""
    before = os.environ.get(CHOICE)
    os.environ[CHOICE] = choice
    try:
        ended = simulate(str(path), out, [f"duration={steps / 512!r}"]).outcome
    finally:
        os.environ.pop(CHOICE)
        if before is not None:
            os.environ[CHOICE] = before
    assert ended.fault is None
    return ended.wall_time


def measured(n: int, signals: int, rounds: int, folder: Path) -> Row:
    """Microseconds per macro step, by master."""
    path = folder / "ring.toml"
    path.write_text(scene(n, signals))
    ssp = export(str(path), out=folder / "ring.ssp")
    with zipfile.ZipFile(ssp) as archive:
        archive.extractall(folder / "ssp")
    ring = Ring(Path(ssp), folder / "ssp", n)
    loops: Mapping[str, Callable[[int], float]] = {
        "C loop": lambda steps: masters.bare(ring, steps, folder),
        OURS: lambda steps: ours(path, folder / "out", steps, "compiled"),
        "Ecos": lambda steps: masters.ecos(ring, steps),
        "libcosim": lambda steps: masters.libcosim(ring, steps),
        "FMPy": lambda steps: masters.fmpy(ring, steps, folder),
        PYTHON: lambda steps: ours(path, folder / "out", steps, "python"),
    }
    steps = CALLS // n
    best: dict[str, list[float]] = {}
    for _ in range(rounds):
        for name, run in loops.items():
            share = 1 if name in ("C loop", OURS) else 10  # the others take longer
            try:
                times = [run(steps // share * times) / (steps // share) for times in (1, 5)]
            except (ImportError, OSError):
                continue
            known = best.setdefault(name, times)
            best[name] = [min(pair) for pair in zip(known, times, strict=True)]
    return {name: 1e6 * (long - short) / 4 for name, (short, long) in best.items()}


def closed_loop(rounds: int, folder: Path) -> Row:
    """Microseconds of processor time per haptic tick of `closed-loop` with native FMUs."""
    fixed = ["packaging=native", "stop_when=''"]
    loops: Mapping[str, Callable[[int], float]] = {
        "C loop": lambda s: bare_scene.seconds(LOOP, fixed, 512 * s, folder / "bare.so"),
        OURS: lambda s: recorded(LOOP, folder / "out", [*fixed, f"duration={s}"]),
    }
    best: dict[str, list[float]] = {}
    for _ in range(rounds):
        for name, run in loops.items():
            times = [run(duration) for duration in DURATIONS]
            known = best.setdefault(name, times)
            best[name] = [min(pair) for pair in zip(known, times, strict=True)]
    ticks = 512 * (DURATIONS[1] - DURATIONS[0])
    return {name: 1e6 * (long - short) / ticks for name, (short, long) in best.items()}


def recorded(scene: str, out: Path, options: list[str]) -> float:
    """Processor time (s) of our loop."""
    event_loop.perf_counter, before = thread_time, event_loop.perf_counter
    try:
        ended = simulate(scene, out, options).outcome
    finally:
        event_loop.perf_counter = before
    assert ended.fault is None
    return ended.wall_time


def bench(folder: Path, quick: bool, told: Callable[[str, int, int], object], command: str) -> None:
    """Write the page to `folder`."""
    if "pass-on" not in BLOCKS:
        BLOCKS.register("pass-on", pass_on)
    cases = QUICK if quick else SIZES
    found = []
    for i, (n, k) in enumerate(cases):
        told(f"{n} FMUs of {k} reals", i, len(cases))
        with tempfile.TemporaryDirectory() as room:
            row = measured(n, k, 2 if quick else ROUNDS, Path(room))
        found.append(((n, k), row))
    with tempfile.TemporaryDirectory() as room:
        whole = closed_loop(3 if quick else ROUNDS, Path(room))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "README.md").write_text(page(found, whole, command))


def page(found: list[tuple[tuple[int, int], Row]], whole: Row, command: str) -> str:
    """The page: how many times as long the others take, and the table."""
    rows = [row for _, row in found]
    shares = [
        f"{name} {min(row[name] / row[OURS] for row in rows):.0f} to "
        f"{max(row[name] / row[OURS] for row in rows):.0f} times"
        for name in ("Ecos", "libcosim", "FMPy")
        if all(name in row for row in rows)
    ]
    names = list(dict.fromkeys(name for row in rows for name in row))
    lines = [
        "# Masters",
        "",
        f"{', '.join(shares)} as long as the loop of hapticlink takes.",
        "",
        "Microseconds per macro step of a ring of native FMUs that pass on their inputs, "
        "y = u/2 + 1, with Jacobi coupling at one rate. hapticlink records every output; the "
        f"others record nothing. Start-up is left out. Made by `{command}`.",
        "",
        f"| FMUs | reals of each | {' | '.join(names)} |",
        "|---|---|" + "---|" * len(names),
    ]
    for (n, k), row in found:
        cells = " | ".join(f"{row[name]:.3g}" if name in row else "" for name in names)
        lines.append(f"| {n} | {k} | {cells} |")
    ours, alone = whole[OURS], whole["C loop"]
    lines += [
        "",
        f"`{LOOP}` with native FMUs takes {ours:.3g} us of processor time per haptic tick "
        f"({1e6 / 512 / ours:.0f} times real time), with holds, energies, checks and every output "
        f"recorded: {ours / alone:.2f} times the {alone:.3g} us of a C loop that only sets, steps "
        "and gets its FMUs.",
    ]
    return "\n".join([*lines, ""])
