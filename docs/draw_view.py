"""Draws the screenshots of results/view/: the page at work in a headless Chromium.

`python docs/draw_view.py [NAME ...]`, with playwright and Debian's chromium installed.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

OUT = Path(__file__).parents[1] / "results" / "view"
PAGE_OF_SPACE = Path(__file__).parent / "space.md"
IN_SPACE = re.compile(r'^```toml title="(.+?)"\n(.*?)^```', re.DOTALL | re.MULTILINE)
"""The scenes of a page, and what they are called."""
SHOTS: dict[str, tuple[str, tuple[int, int], tuple[tuple[float, float], ...]]] = {
    "closed_loop": ("closed-loop", (1360, 820), ((-0.02, 0.02), (0.012, 0.03))),
    "enclosure": ("enclosure", (1360, 820), ((-0.01, 0.02), (-0.005, 0.035))),
    "two_users": ("two-users", (1360, 820), ((-0.01, 0.012),)),
    "narrow": ("closed-loop", (400, 860), ((-0.02, 0.02), (0.012, 0.03))),
    "bennett": ("bennett.toml", (1280, 800), ((0.06, 0.05),)),
}
"""By file, the scene, shipped or of docs/space.md, the window (px), and a path of the mouse from
the operational point (m, to the right and up)."""
OTHERS = {"two_users": ("left", ((0.012, -0.012),))}
"""By file, the point of the user who drags in a second window, and that one's path (m)."""

DIRECT = "closed_loop_direct.html#graphics.rate=11"
OF_FILE: dict[str, tuple[str, tuple[int, int], tuple[float, float]]] = {
    "a_and_b": (
        "closed_loop.html#graphics.rate=10&b.controller.topology=false", (1360, 820), (0.03, 0.03)
    ),
    "first_minute": (DIRECT, (1280, 800), (0.006, 0.012)),
    "first_minute_narrow": (DIRECT, (400, 800), (0.006, 0.012)),
}  # fmt: skip
"""By file, the link to a page in one file, of `hapticlink view SCENE --standalone`, the window
(px), and where the mouse goes from the operational point (m)."""


VIBRATES = """() => document.getElementById('said').innerText.match(/by (.+) mm/)?.[1] > 4
    && !document.getElementById('ended').innerText"""


def dragged(
    page: Any, path: tuple[tuple[float, float], ...], user: str = "", rest: int = 1500
) -> None:
    """Drag along a path, and stay at each of its points (ms), at last with the button down."""
    page.wait_for_function("() => view.frame && view.stage.limits && view.frame.t > 0.5")
    x, y, scale = page.evaluate(
        """(user) => { const box = view.stage.canvas.getBoundingClientRect();
                       const point = (user ? view.frame.others[user] : view.frame).x;
                       const [x, y] = view.stage.toScreen(point);
                       return [box.left + x, box.top + y, view.stage.scale]; }""",
        user,
    )
    page.mouse.move(x, y)
    page.mouse.down()
    for dx, dy in path:
        page.mouse.move(x + scale * dx, y - scale * dy, steps=40)
        page.wait_for_timeout(rest)


def of_file(browser: Any, name: str) -> None:
    """The page in one file, dragged."""
    link, (width, height), path = OF_FILE[name]
    page = browser.new_page(viewport={"width": width, "height": height})
    page.goto(f"file://{OUT / link}")
    if "&b." in link:
        page.wait_for_function("() => view.frame?.b")
    first_minute = name.startswith("first_minute")
    dragged(page, (path,), rest=0 if first_minute else 1500)
    if first_minute:  # in this very picture, by more than the handle is wide
        page.wait_for_function(VIBRATES, timeout=60_000)
    page.screenshot(path=OUT / f"{name}.png")
    page.close()


@contextmanager
def served(scene: str, folder: str) -> Iterator[str]:
    """The address at which the page of a scene is served, which ends with the context."""
    command = [sys.executable, "-m", "hapticlink", "view", scene, "--no-browser", "--port", "0"]
    serving = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    try:
        assert serving.stdout
        found = re.search(r"http://\S+", serving.stdout.readline())
        assert found
        yield found[0]
    finally:
        serving.send_signal(signal.SIGTERM)
        serving.wait()


def main(names: Collection[str]) -> None:
    OUT.mkdir(exist_ok=True)
    with sync_playwright() as started, tempfile.TemporaryDirectory() as folder:
        for title, scene in IN_SPACE.findall(PAGE_OF_SPACE.read_text(encoding="utf-8")):
            (Path(folder) / title).write_text(scene, encoding="utf-8")
        browser = started.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        for name in names or (*SHOTS, *OF_FILE):
            if name in OF_FILE:
                of_file(browser, name)
                continue
            scene, (width, height), path = SHOTS[name]
            window = {"viewport": {"width": width, "height": height}, "bypass_csp": True}
            with served(scene, folder) as address:
                page = browser.new_page(**window)
                page.goto(address)
                if name in OTHERS:
                    user, other = OTHERS[name]
                    second = browser.new_page(**window)
                    second.goto(address)
                    dragged(second, other, user)
                dragged(page, path)
                page.screenshot(path=OUT / f"{name}.png")
                for each in [*browser.contexts]:
                    each.close()


if __name__ == "__main__":
    main(sys.argv[1:])
