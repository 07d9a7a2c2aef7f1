"""The page in use: 60 s of scripted dragging at 512 Hz, with the deadlines that the haptic loop
missed, the latencies of what a person feels and sees, and how long the stability verdict takes.

    mouse to force    from the mouse event in the browser to the step of the hand that takes the
                      pull, whose force acts from that instant on
    step to screen    from when a frame's newest step was due to the refresh of the screen that
                      follows the drawing of it (requestAnimationFrame)

Both clocks are the machine's: the browser's `performance.timeOrigin` is wall-clock time.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import hapticlink as hl
from benchmarks.page import Progress, load_average, system, table
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.real_time_session import LiveRun
from hapticlink.orchestrator.results.numbers import short
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from hapticlink.visualization.live_page.server_pipe import ChildProcess
from hapticlink.visualization.live_page.session import LiveSession

SCENE, RATE, SECONDS, QUICK = "closed-loop-ideal", 512, 60, 5
SERVER = "hapticlink.visualization.live_page.server"


class Done(Exception):
    """The dragging has ended."""


class Measured(LiveSession):
    """A session that ends with the process of the dragging, and notes when pulls act, and by how
    much wall-clock time is ahead of simulated time."""

    def begin(self, driver: subprocess.Popen[str]) -> None:
        """Run until the driver has ended."""
        self.driver = driver
        self.acted: dict[tuple[float, float], float] = {}
        self.ahead: list[tuple[float, float]] = []
        self.before: dict[str, Any] = {}
        with suppress(Done):
            self.run()

    def _turn(self, live: LiveRun) -> None:
        pace = live._run.pace
        self.ahead.append((live.time, time.time() - 1e-9 * (pace.now() - pace.c.origin)))
        if not self.before and self.acted:
            self.before = live.report()
        if not hasattr(live, "noted"):
            self._note_pulls(live)
        super()._turn(live)
        if self.driver.poll() is not None:
            self.after = live.report()
            raise Done

    def _note_pulls(self, live: LiveRun) -> None:
        given = live.set

        def noted(name: str, value: ArrayLike) -> None:
            given(name, value)
            if name == "hand.target":
                x, y = np.ravel(value)[:2].tolist()
                hand = live._simulation.instances["hand"]
                hand.before_step(lambda _: self.acted.setdefault((x, y), time.time()))

        live.set, live.noted = noted, True  # type: ignore[method-assign,attr-defined]


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> str:
    """Raises what playwright does without a browser."""
    seconds, load = QUICK if quick else SECONDS, load_average()
    scene = load_viewed_scene(SCENE, [f"haptics.rate={RATE}"])
    progress(f"{SCENE}, dragged", 0, seconds)
    arguments = "127.0.0.1", "0", "bench", "", ""  # no second run
    with temporary_folders.temporary_folder() as room, ChildProcess(SERVER, *arguments) as link:
        url = f"http://127.0.0.1:{link.first()['port']}/bench/"
        log = Path(room, "log.json")
        with log.open("w") as out:
            dragging = [sys.executable, "-m", "benchmarks.dragging", url, str(seconds)]
            root = Path(__file__).parents[1]
            driver = subprocess.Popen(dragging, cwd=root, stdout=out, text=True)
        try:
            session = Measured(scene, link, Path(room, "made"), hl.RealTime)
            session.begin(driver)
        finally:
            driver.kill()
            driver.wait()
        found = json.loads(log.read_text())
    readme = folder / "README.md"
    kept = readme.read_text().partition(AFTER)[2] if readme.exists() else ""
    return page(session, found, seconds, load, command) + AFTER + kept


AFTER = "\n## Screenshots\n"
"""What follows it on the page stays as it is."""


def latencies(session: Measured, found: dict[str, Any]) -> dict[str, list[float]]:
    """The latencies (s), one for each pull that acted and each frame that was shown."""
    sent = {(x, y): at for x, y, at in found["sent"]}
    felt = [session.acted[pull] - at for pull, at in sent.items() if pull in session.acted]
    due = dict(session.ahead)
    rows = [(t, drawn, seen) for t, drawn, seen in found["shown"] if t in due and seen]
    return {
        "mouse to force": felt,
        "step to canvas": [drawn - (t + due[t]) for t, drawn, _ in rows],
        "step to screen": [seen - (t + due[t]) for t, _, seen in rows],
    }


def page(session: Measured, found: dict[str, Any], seconds: int, load: float, command: str) -> str:
    before, after = session.before, session.after
    ticks, missed = (after[k] - before[k] for k in ("ticks", "deadlines_missed"))
    rows = latencies(session, found)
    if missing := [name for name, values in rows.items() if not values]:
        raise InputFault(f"nothing was measured of {', '.join(missing)}: is the machine busy?")
    felt, shown = (1e3 * float(np.median(rows[k])) for k in ("mouse to force", "step to screen"))
    taken, judged = len(rows["mouse to force"]), found["judged"]
    lines = [
        "# The page in use",
        "",
        f"In {seconds} s of dragging at {RATE} Hz the haptic loop of `{SCENE}` missed {missed} of "
        f"{ticks} deadlines; a pull of the mouse is felt after {short(felt)} ms, and a step is on "
        f"the screen after {short(shown)} ms (medians). A stability verdict stands "
        f"{short(max(first for first, _ in judged.values()))} s after a change.",
        "",
        f"Made by `{command}`, on {system()}, shared with a headless Chromium that draws in "
        f"software, and a load average of {load:.1f} before. Latencies in milliseconds: mouse to "
        f"force, from the mouse event to the step of the hand that takes the pull ({taken} of "
        f"{len(found['sent'])} pulls: newer ones replace those that wait for the same step); "
        "step to canvas and to screen, from when the newest step of a frame was due to the end of "
        f"drawing it, and to the refresh after that ({len(rows['step to screen'])} frames).",
        "",
        *table("| p50 | p99 | max", "lrrr", _rows(rows, after)),
        "",
        "Seconds from a change on the page, with the handle held, to the stability verdict on the "
        "first hands and on all:",
        "",
        *table(
            "changed | so far | all hands",
            "lrr",
            ([name, *map(short, times)] for name, times in judged.items()),
        ),
        "",
    ]
    return "\n".join(lines)


def _rows(
    latencies: Mapping[str, Sequence[float]], report: Mapping[str, Any]
) -> Iterator[list[str]]:
    """Milliseconds of the latencies, and of the haptic loop."""
    for name, values in latencies.items():
        yield [name, *(short(1e3 * float(v)) for v in np.quantile(values, [0.5, 0.99, 1.0]))]
    for name, key in (("step time", "step_time"), ("lateness", "lateness")):
        times = (short(1e3 * report[key][k]) for k in ("p50", "p99", "max"))
        yield [f"{name} of the haptic loop, since its start", *times]
