"""Draws the figures of docs/trials.md: python docs/draw_trial.py

trial.png has the answers of a simulated observer, trial_page.png a trial on a page in a headless
Chromium, with playwright and Debian's chromium installed.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from draw_view import dragged
from playwright.sync_api import sync_playwright

from hapticlink.analysis.trials.blind_trial import BlindTrial
from hapticlink.visualization.figure_files import save
from hapticlink.visualization.figures import trial_figure

OUT = Path(__file__).parent / "figures"
THRESHOLD, SLOPE, LAPSE = 20.0, -5.0, 0.02
"""Of the observer, in Hz and 1/log(Hz)."""
TRIAL = ("closed-loop-direct", "--page", "--vary", "graphics.rate=13", "--set", "duration=4")
PATH = ((-0.01, 0.01), (0.006, 0.012))
"""Of the mouse from the operational point (m, to the right and up)."""


def draw_answers() -> None:
    draw = np.random.default_rng(3)
    trial = BlindTrial.of(["graphics.rate=8,11,16,22,31,44,62"])
    felt: list[tuple[int, float]] = []

    def present(number: int, place: int, settings: dict[str, str]) -> None:
        if settings:
            felt.append((place, float(settings["graphics.rate"])))

    def ask(number: int) -> int:
        varied, rate = felt[-1]
        told = 1 / (1 + math.exp(-SLOPE * math.log(rate / THRESHOLD)))
        return varied if draw.random() < 0.5 + (0.5 - LAPSE) * told else 3 - varied

    trial.ask(present, ask, repeats=24, seed=3)  # type: ignore[arg-type]
    save({"trial": trial_figure.draw(trial)}, OUT)


def draw_page() -> None:
    """Both of a trial are felt, and the page asks which was varied."""
    command = [sys.executable, "-m", "hapticlink", "trial", *TRIAL]
    with (
        sync_playwright() as started,
        tempfile.TemporaryDirectory() as room,
        subprocess.Popen(
            [*command, "--no-browser", "--port", "0", "--out", room],
            stdout=subprocess.PIPE,
            text=True,
        ) as served,
    ):
        assert served.stdout
        found = re.search(r"http://\S+", served.stdout.readline())
        assert found
        browser = started.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1000, "height": 640}, bypass_csp=True)
        page.goto(found[0])
        for number in ("1, 1", "1, 2"):
            page.get_by_text(f"trial {number}").wait_for()
            page.get_by_role("button", name="Feel it").click()
            dragged(page, PATH, rest=1000)
            page.mouse.up()
        page.get_by_role("button", name="The first").wait_for()
        page.screenshot(path=OUT / "trial_page.png")
        page.get_by_role("button", name="End the trials").click()


if __name__ == "__main__":
    draw_answers()
    draw_page()
