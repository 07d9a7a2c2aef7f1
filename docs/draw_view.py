"""Draws the screenshots of results/view/: the page at work in a headless Chromium.

`python docs/draw_view.py`, with playwright and Debian's chromium installed.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

OUT = Path(__file__).parents[1] / "results" / "view"
SHOTS: dict[str, tuple[str, tuple[int, int], tuple[tuple[float, float], ...]]] = {
    "closed_loop": ("closed-loop", (1360, 820), ((-0.02, 0.02), (0.012, 0.03))),
    "enclosure": ("enclosure", (1360, 820), ((-0.01, 0.02), (-0.005, 0.035))),
    "narrow": ("closed-loop", (400, 860), ((-0.02, 0.02), (0.012, 0.03))),
}
"""By file, the scene, the window (px), and a path of the mouse from the operational point (m)."""


def dragged(page: Any, path: tuple[tuple[float, float], ...]) -> None:
    """Drag along a path, and stay at its end for a while with the button down."""
    page.wait_for_function("() => view.frame && view.stage.limits && view.frame.t > 0.5")
    x, y, scale = page.evaluate(
        """() => { const box = view.stage.canvas.getBoundingClientRect();
                   const [x, y] = view.stage.toScreen(view.frame.x);
                   return [box.left + x, box.top + y, view.stage.scale]; }"""
    )
    page.mouse.move(x, y)
    page.mouse.down()
    for dx, dy in path:
        page.mouse.move(x + scale * dx, y - scale * dy, steps=40)
        page.wait_for_timeout(1500)


def main() -> None:
    OUT.mkdir(exist_ok=True)
    with sync_playwright() as started, tempfile.TemporaryDirectory() as folder:
        browser = started.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        for name, (scene, (width, height), path) in SHOTS.items():
            command = [sys.executable, "-m", "hapticlink.orchestrator", "view", scene]
            served = subprocess.Popen(
                [*command, "--no-browser", "--port", "0"],
                cwd=folder, stdout=subprocess.PIPE, text=True,
            )  # fmt: skip
            assert served.stdout
            found = re.search(r"http://\S+", served.stdout.readline())
            assert found
            page = browser.new_page(viewport={"width": width, "height": height}, bypass_csp=True)
            page.goto(found[0])
            dragged(page, path)
            page.screenshot(path=OUT / f"{name}.png")
            page.close()
            served.send_signal(signal.SIGTERM)
            served.wait()


if __name__ == "__main__":
    main()
