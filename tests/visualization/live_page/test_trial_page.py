"""A blind trial on a page: what a window gets, and what is logged of its answers."""

from __future__ import annotations

import csv
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import hapticlink as hl
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from hapticlink.visualization.live_page import messages
from hapticlink.visualization.live_page.trial_page import TrialPage
from tests.visualization.browser_code.chromium import Page
from tests.visualization.browser_code.served_page import SCENE

QUESTION = "document.getElementById('question').textContent"
ASKED = "document.querySelector('#answers button')"


class Link:
    """A page whose answers are a function of the questions that it was sent."""

    def __init__(self, answer: Callable[[dict[str, Any]], list[messages.TrialReply]]) -> None:
        self.sent: list[dict[str, Any]] = []
        self.alive, self._answer = True, answer

    def send(self, message: dict[str, Any], frame: bool = False) -> None:
        self.sent.append(message)

    def received(self) -> list[messages.TrialReply]:
        asked = [m for m in self.sent if m["type"] == "question" and m["answers"]]
        return self._answer(asked[-1]) if asked else []


def test_an_answer_is_one_to_its_question_and_nothing_tells_the_setting(tmp_path: Path) -> None:
    def answer(asked: dict[str, Any]) -> list[messages.TrialReply]:
        number = asked["question"]
        late = messages.TrialReply("answer", number - 1, "2")  # of a button that was pressed twice
        other = messages.TrialReply("answer", number, "3")
        given = "1" if "which" in asked["text"] else "y"
        return [late, other, messages.TrialReply("answer", number, given)]

    link = Link(answer)
    scene = load_viewed_scene("closed-loop-ideal", {"packaging": "python"}, 0.05)
    page = TrialPage(link, hl.RealTime, scene)  # type: ignore[arg-type]
    made = hl.trial(
        scene, ["graphics.rate=20,64"], ask=page.ask, feel=page.feel, out=tmp_path, repeats=1
    )
    assert [answer.answer for answer in made.trial.answers] == [1, 1]
    assert {m["type"] for m in link.sent} == {"opening", "scene", "frame", "question"}
    assert not re.search("graphics|rate", str([m for m in link.sent if m["type"] == "question"]))
    felt = [hl.load(tmp_path / "felt" / f"001-{place}").run["scene"] for place in (1, 2)]
    rates = [each["graphics"]["rate"] for each in felt]
    (row, _) = csv.DictReader((tmp_path / "answers.csv").open())
    assert str(rates[int(row["varied"]) - 1]).removesuffix(".0") == row["graphics.rate"]
    link.alive = False
    with pytest.raises(hl.Fault, match="the page's server has ended"):
        page.ask("ready?", "y/q")


def test_a_trial_in_a_browser(browser: Any, tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(SCENE)
    command = [sys.executable, "-m", "hapticlink", "trial", "scene.toml", "--page", "--no-browser"]
    options = ("--port", "0", "--vary", "graphics.rate=16", "--repeats", "1", "--out", "made")
    with subprocess.Popen(
        [*command, *options, "--set", "duration=0.5"], cwd=tmp_path, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:  # fmt: skip
        assert process.stdout
        url = process.stdout.readline().split(": ", 1)[1].strip()
        try:
            page = Page(browser, url, shown=f"{ASKED}?.textContent === 'Feel it'")
            for place in (1, 2):
                page.until(f"{QUESTION}.startsWith('trial 1, {place}') && {ASKED}")
                page.page.click("#answers button")
            page.until(f"{ASKED}?.textContent === 'The first'")
            for hidden in ("#settings", "#charts", "header .buttons", "#verdict"):
                assert not page.page.is_visible(hidden)
            page.page.click("#answers button:nth-child(2)")
            page.until(f"{QUESTION}.includes('have ended')")
            said = process.communicate()[0]
        finally:
            process.kill()
    assert process.returncode == 0, said
    assert page.faults == []
    (row,) = csv.DictReader((tmp_path / "made" / "answers.csv").open())
    assert (row["answer"], row["graphics.rate"]) == ("2", "16")
    assert (tmp_path / "made" / "felt" / "001-2" / "haptics.csv").stat().st_size > 0
    page.page.close()
