"""Resets, changes of holds, delays, rates and gains at random behind a page: `LiveSession` itself,
whose page is played here, in one process for all cases.

Whatever the page asks for: a reset begins a run anew, a change is described or refused, and what a
case leaves behind does not add up: no file handles, no memory maps, and no memory beyond
MOST_BYTES for each thing that was asked for.
"""

from __future__ import annotations

import gc
import os
import random
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hapticlink as hl
from fuzz.cases import Made, seeded
from fuzz.processes import own_folder
from hapticlink.orchestrator.base.errors import Fault
from hapticlink.visualization.live_page import messages
from hapticlink.visualization.live_page.session import LiveSession

ASKED = {"resets": 10, "holds": 100, "anything": 50}
"""What a case of each kind asks for, so often."""
MOST_BYTES = {"resets": 40_000, "holds": 4_000, "anything": 20_000}
"""That a reset, a change may leave, on average over the second half of the cases."""
PATIENCE = 60.0
"""Seconds without an answer after which a session counts as hung."""


class Page:
    """In the place of the server's pipe: asks for the next thing where the last one is answered."""

    def __init__(self, kind: str, draw: random.Random) -> None:
        self._kind, self._draw = kind, draw
        self.left, self.wrong, self.alive = ASKED[kind], "", True
        self._awaited: tuple[str, ...] = ("controls",)
        self._controls: list[dict[str, Any]] = []
        self._since = time.monotonic()

    def send(self, message: dict[str, Any], frame: bool = False) -> None:
        if message["type"] == "controls":
            self._controls = message["controls"]
        if message["type"] in self._awaited:
            self._awaited, self._since = (), time.monotonic()

    def received(self) -> list[Any]:
        if self._awaited:
            if time.monotonic() - self._since > PATIENCE:
                self.wrong, self.alive = f"no answer to {self._awaited}", False
            return []
        if not self.left:
            self.alive = False
            return []
        self.left -= 1
        asked = self._asked()
        self._awaited = ("scene",) if isinstance(asked, messages.Time) else ("controls", "refused")
        return [asked]

    def _asked(self) -> messages.Message:
        draw = self._draw
        held = draw.choice([control for control in self._controls if "choices" in control])
        hold = messages.SetControl("set", held["key"], draw.choice(held["choices"]))
        reset = messages.Time("time", "reset")
        if self._kind != "anything":
            return reset if self._kind == "resets" else hold
        keys = [control["key"] for control in self._controls]
        values = {
            draw.choice([k for k in keys if k.startswith("delays.")]): draw.choice(
                (0.0, 1e-3, 1e-2)
            ),
            "graphics.rate": draw.uniform(10.0, 60.0),
            "jitter": draw.uniform(0.0, 0.5),
            draw.choice([k for k in keys if k.startswith("gains.")]): draw.uniform(0.5, 2.0),
            "controller.topology": draw.random() < 0.5,
        }
        sets = [messages.SetControl("set", key, value) for key, value in values.items()]
        return draw.choice((reset, hold, *sets))


def _left_behind() -> tuple[int, int, int]:
    """Bytes, memory maps and file handles of this process."""
    gc.collect()
    own = Path("/proc/self")
    pages = int((own / "statm").read_text().split()[1])
    return pages * 4096, len((own / "maps").read_text().splitlines()), len(os.listdir(own / "fd"))


def _case(scene: Any, kind: str, draw: random.Random, folder: Path) -> tuple[str, str]:
    page = Page(kind, draw)
    session = LiveSession(scene, page, folder / "view", hl.RealTime)  # type: ignore[arg-type]
    try:
        session.run()
    except Fault as ended:
        if not page.alive and not page.wrong:
            return "done", ""
        return ("hung" if page.wrong else "crashed"), f"{page.wrong} {ended}"
    return "crashed", "the session has returned"


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` sessions, the kinds in turn, of Python and of native FMUs."""
    if sys.platform != "linux":
        return
    places = [(kind, packed) for packed in ("python", "native") for kind in ASKED]
    before: dict[str, list[tuple[int, int, int]]] = {}
    with own_folder() as folder:
        for i, case, draw in seeded(number, seed):
            kind, packed = places[i * len(places) // number]
            name = f"{kind}, {packed} FMUs"
            scene = hl.scene("closed-loop-ideal", {"packaging": packed, "duration": 1e4})
            outcome, wrong = _case(scene, kind, draw, folder)
            counts = before.setdefault(name, [])
            counts.append(_left_behind())
            if outcome == "done" and len(counts) > 3:
                first = counts[len(counts) // 2]
                grown = [now - then for now, then in zip(counts[-1], first, strict=True)]
                asked = (len(counts) - 1 - len(counts) // 2) * ASKED[kind]
                said = f"{name}: {len(counts) * ASKED[kind]}: +{grown} in the last {asked}"
                print(said, file=sys.stderr, flush=True)
                if grown[0] > 2**20 + MOST_BYTES[kind] * asked or grown[1] > 40 or grown[2] > 2:
                    outcome, wrong = "lost", said
            yield Made(name, case, outcome, wrong)
