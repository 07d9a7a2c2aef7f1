"""A headless Chromium drags a handle on a page, and says when: `python -m benchmarks.dragging URL
SECONDS`, in a process of its own. Prints JSON with times of the wall clock (s):

sent    [x, y (m), time of the mouse event] of each pull that the page sent
shown   [simulated time of the frame, time at which the page had drawn it, time of the next
         refresh of the screen, requestAnimationFrame]
judged  by what was changed, seconds from the change to the first stability verdict and to the last
"""

from __future__ import annotations

import json
import math
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

EVERY = 1 / 60  # s, of a mouse that moves
RADIUS, TURN = 0.012, 2.0  # m and s of the circle that it moves along

NOTE = """() => {
  const log = window.log = { sent: [], shown: [] }, stage = view.stage;
  const draw = stage.draw.bind(stage), wall = (ms) => (performance.timeOrigin + ms) / 1e3;
  let last = null;
  stage.draw = (frame) => {
    draw(frame);
    if (frame.t === last) return;
    last = frame.t;
    const row = [frame.t, wall(performance.now()), null];
    log.shown.push(row);
    requestAnimationFrame((now) => { row[2] = wall(now); });
  };
  stage.canvas.addEventListener("pointermove", (event) => {
    const held = [...stage.pulls.values()][0];
    if (held?.sent >= event.timeStamp) log.sent.push([...held.target, wall(event.timeStamp)]);
  });
  const box = stage.canvas.getBoundingClientRect(), [x, y] = stage.toScreen(view.frame.x);
  return [box.left + x, box.top + y, stage.scale];
}"""
"""Notes the times, and returns the operational point on the screen (px) and px to a metre."""

CHANGES = {
    "rate": ("[data-control='graphics.rate']", 12),
    "hold": ("select[data-control]", "foh"),
    "gain": ("[data-control='gains.controller.K_pc']", 0.1),
}
"""By name, the control and its new value."""
JUDGED = """([selector, value]) => new Promise((resolve) => {
  const control = document.querySelector(selector), begun = performance.now(), before = view.map;
  let first = null;
  control.value = value;
  control.dispatchEvent(new Event(control.tagName === "SELECT" ? "change" : "input"));
  const look = () => {
    const { map } = view, now = (performance.now() - begun) / 1e3;
    if (map !== before && map.said !== "computing") first ??= now;
    if (first !== null && !map.said.endsWith("so far")) resolve([first, now]);
    else setTimeout(look, 5);
  };
  look();
})"""
"""Sets a control, and returns the times (s) until there is a verdict, so far and of all hands."""


@contextmanager
def chromium() -> Iterator[Any]:
    """A headless browser of the machine's own."""
    from playwright.sync_api import sync_playwright

    path = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as started:
        flags = ["--no-sandbox", "--disable-gpu"]
        yield started.chromium.launch(executable_path=path, args=flags)


def dragged(page: Any, seconds: float) -> dict[str, Any]:
    """Drag around a circle."""
    page.wait_for_function("() => view.frame && view.stage.limits && view.frame.t > 1.0")
    x, y, scale = page.evaluate(NOTE)
    page.mouse.move(x, y)
    page.mouse.down()
    start = time.monotonic()
    while (now := time.monotonic() - start) < seconds:
        angle = 2 * math.pi * now / TURN
        dx, dy = RADIUS * (math.cos(angle) - 1), RADIUS * math.sin(angle)
        page.mouse.move(x + scale * dx, y - scale * dy)
        time.sleep(max(0.0, start + now + EVERY - time.monotonic()))
    judged = {name: page.evaluate(JUDGED, [*change]) for name, change in CHANGES.items()}
    page.mouse.up()
    log: dict[str, Any] = page.evaluate("() => window.log")
    return log | {"judged": judged}


def main() -> None:
    url, seconds = sys.argv[1:]
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 1280, "height": 800}, bypass_csp=True)
        page.goto(url)
        json.dump(dragged(page, float(seconds)), sys.stdout)


if __name__ == "__main__":
    main()
