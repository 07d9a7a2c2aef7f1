"""A blind trial on a page: what is felt runs there, and its questions are asked there. Nothing of
the settings is sent to it but the picture of their run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Mapping
from itertools import count
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import Fault
from hapticlink.orchestrator.real_time_session import LiveRun
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.visualization.live_and_standalone import first_messages
from hapticlink.visualization.live_page import messages
from hapticlink.visualization.live_page.controls import Controls
from hapticlink.visualization.live_page.frames import FrameReader
from hapticlink.visualization.live_page.server_pipe import Pipe
from hapticlink.visualization.live_page.session import TURN, WAIT

LABELS = {"y": "Feel it", "1": "The first", "2": "The second", "q": "End the trials"}
"""What buttons say, by the answer that they give."""
FAREWELL = 2.0
"""Time (s) for a window to show the last words."""


class TrialPage:
    """Asks by the page at the other end of a link, and lets scenes be felt there: real_time is
    `hl.RealTime`, which runs a scene and writes its folder as `hl.run` does. scene: which is shown
    at first."""

    def __init__(self, link: Pipe, real_time: Callable[[Scene], Any], scene: Scene) -> None:
        self._link, self._real_time = link, real_time
        self._numbers, self._failed = count(1), ""
        link.send(first_messages.describe_opening(scene))

    def ask(self, question: str, answers: str) -> str:
        """The answer, one of those that / separates, to a question; "q" at Ctrl-C. Raises Fault
        where the page's server has ended."""
        text, self._failed = f"{self._failed}{question}", ""
        offered = {each: LABELS[each] for each in answers.split("/")}
        given = self._answer(self._say(text, offered), offered)
        self._say(question.partition(":")[0], {})
        return given or "q"

    def tell(self, text: str) -> None:
        """Say last what has no answer; a window that shows it says so, and leaves."""
        self._answer(self._say(text, {}, over=True), ["seen"], FAREWELL)

    def _answer(self, number: int, offered: Collection[str], seconds: float = math.inf) -> str:
        """The first answer to a question of those offered, "" at Ctrl-C and after a time (s)."""
        until = time.monotonic() + seconds
        while not interrupt.came() and time.monotonic() < until:
            for message in self._received():
                answered = isinstance(message, messages.TrialReply) and message.question == number
                if answered and message.given in offered:
                    return str(message.given)
            time.sleep(WAIT)
        return ""

    def feel(self, scene: Scene, folder: Path) -> None:
        """Run a scene, pulled by the mouse or held by a board, to its duration. One that fails has
        been felt until then, which the next question says."""
        self._link.send(first_messages.describe_opening(scene))
        self._controls: Controls | None = None
        ended = self._real_time(scene).run(self._turn, folder, every=TURN, figures=False)
        self._failed = "it has failed before its end; " if ended.fault else ""

    def _turn(self, live: LiveRun) -> None:
        if self._controls is None:
            self._controls, self._frames = Controls(live, {}), FrameReader(live)
            about = first_messages.describe_viewed_run(live.scene, live.system, live.energies())
            self._link.send(about)
        for message in messages.newest(self._received()):
            if isinstance(message, messages.Hand):
                self._controls.apply(message)
        self._frames.send(live, self._link, self._controls.pulled)

    def _received(self) -> list[Any]:
        if not self._link.alive:
            raise Fault("the page's server has ended: start `hapticlink trial` again")
        return self._link.received()

    def _say(self, text: str, offered: Mapping[str, str], over: bool = False) -> int:
        """Show a question with a button for each answer; its number."""
        number = next(self._numbers)
        about = {"text": text, "answers": [*offered.items()], "question": number, "over": over}
        self._link.send({"type": "question"} | about)
        return number
