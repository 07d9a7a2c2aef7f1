"""A headless Chromium on a page; without one the tests that need it are skipped."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
AT = """() => {
  const box = view.stage.canvas.getBoundingClientRect();
  const [x, y] = view.stage.toScreen(view.frame.x);
  return [box.left + x, box.top + y, view.stage.scale];
}"""
"""Of the operational point on the screen (px), and px to a metre."""


@contextmanager
def chromium(bypass_csp: bool = True) -> Iterator[Any]:
    """A browser with a profile of its own; bypass_csp: tests may do what pages forbid."""
    if not CHROMIUM:
        pytest.skip("chromium is not installed")
    with tempfile.TemporaryDirectory() as profile, playwright.sync_playwright() as started:
        yield started.chromium.launch_persistent_context(
            profile, executable_path=CHROMIUM, args=FLAGS, bypass_csp=bypass_csp
        )


class Page:
    """A page in a window of a size, by day or in the dark, with what went wrong in it; `shown` is
    awaited, by default that it shows a run."""

    def __init__(
        self,
        browser: Any,
        url: str,
        width: int = 1280,
        height: int = 800,
        dark: bool = False,
        shown: str = "window.view?.frame && view.stage.limits",
    ) -> None:
        self.faults: list[str] = []
        self.page = browser.new_page()
        self.page.emulate_media(color_scheme="dark" if dark else "light")
        self.page.set_viewport_size({"width": width, "height": height})
        self.page.on("console", lambda said: self.faults.append(said.text))
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("requestfailed", lambda request: self.faults.append(request.url))
        self.page.goto(url)
        self.until(shown)

    def until(self, condition: str) -> None:
        """Wait for a condition in JavaScript."""
        try:
            self.page.wait_for_function(f"() => {condition}", timeout=120_000)
        except playwright.TimeoutError:
            shown = self.get("JSON.stringify([view.state, view.refused, view.frames, view.frame])")
            raise AssertionError(f"{condition} did not come; the page has {shown}") from None

    def get(self, expression: str) -> Any:
        """The value of an expression in JavaScript."""
        return self.page.evaluate(f"() => {expression}")

    def run_for(self, seconds: float) -> None:
        """Wait for simulated time; what was done before it may come to the run later than that."""
        self.until(f"view.frame?.t > {self.get('view.frame.t') + seconds}")

    def pull(self, dx: float, dy: float) -> None:
        """Press at the operational point and drag by (dx, dy) m; the button stays down."""
        x, y, scale = self.page.evaluate(AT)
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(x + scale * dx, y - scale * dy, steps=10)


def differ_without_topology(page: Page) -> None:
    """Of two runs under one mouse: without its topology controller B follows the mouse further, and
    has energies of its own. The mouse stays down."""
    page.page.click("#acts")
    page.page.uncheck("[data-control='controller.topology']")
    page.until("location.hash === '#b.controller.topology=false'")
    page.pull(0.03, 0.03)
    error = "((f) => Math.hypot(f.x[0] - f.handle[0], f.x[1] - f.handle[1]))"
    page.until(f"{error}(view.frame.b) > 3 * {error}(view.frame)")
    energies = page.get("[view.frame.energy, view.frame.b.energy].map((e) => Object.values(e))")
    assert len(energies[0]) > 3
    assert energies[0] != energies[1]
    said = page.page.locator(
        "[data-chart='energy generated since the start'] figcaption b"
    ).first.inner_text()
    assert " | " in said


REAL_TIME_FACTOR = (
    "document.querySelector('label:has([data-control=\"speed\"]) output').textContent"
)


def assert_slow_motion(page: Page, factor: float) -> None:
    """Simulated time goes on, and by no more than this share of the clock's: a loaded machine is
    slower still."""
    page.until(f"{REAL_TIME_FACTOR} === '{factor:g}×'")
    page.run_for(0.001)
    clock, simulated = page.get(
        """new Promise((done) => {
          const [clock, time] = [performance.now(), view.frame.t];
          setTimeout(() => done([(performance.now() - clock) / 1e3, view.frame.t - time]), 1500);
        })"""
    )
    assert 0 < simulated < factor * clock + 0.02


COLLECT = """() => {
  view.seen = [];
  setInterval(() => {
    const { t, handle: [x, y] } = view.frame ?? { t: -1, handle: [0, 0] };
    if (t > (view.seen.at(-1)?.[0] ?? 0)) view.seen.push([t, x, y]);
    else if (t < view.seen.at(-1)?.[0]) view.seen = [];
  }, 4);
}"""
"""What the page has of the handle, frame by frame."""


VIBRATES = """() => {
  const [, mm] = document.getElementById("said").textContent.match(/vibrates.* by (.+) mm/) ?? [];
  if (!(mm >= 2)) return false;
  view.vibrated = [...view.seen]; // before it grows further
  document.getElementById("remedy").click();
  return true;
}"""
"""Whether the page says so, of 2 mm or more; then the remedy is pressed, and the mouse pulls on."""


def has_its_first_minute(page: Page) -> None:
    """Pulled at 60 Hz the linkage is steady, at 11 Hz it vibrates, and with a softer coupling at
    that rate it does not: as the page says, and as the frames have it."""
    page.until("!document.getElementById('first').hidden")
    assert page.get("document.getElementById('ends').innerText.split(/\\s*\\n/)") == [
        "10 Hz",
        "60 Hz",
    ]
    page.page.evaluate(COLLECT)
    pressed = "document.getElementById('remedy').ariaPressed === "
    rate = "document.getElementById('hertz').textContent === "
    steady = "view.seen.length && view.seen.at(-1)[0] - view.seen[0][0] > 3"
    steady += " && document.getElementById('said').textContent.includes('is steady')"
    page.page.fill("#slow", "22")
    page.until(f"{rate}'60 Hz'")
    page.pull(0.006, 0.012)
    page.run_for(2.0)
    page.until(steady)
    assert page.get(f"{pressed}'false'")
    assert shaken(page.get("view.seen")) < 0.2
    page.page.fill("#slow", "1")
    page.page.wait_for_function(VIBRATES, timeout=120_000)
    assert shaken(page.get("view.vibrated")) > 0.4
    page.until(f"{pressed}'true'")
    page.get("view.seen = []")
    page.until(steady)
    assert shaken(page.get("view.seen")) < 0.2
    assert page.get(f"{rate}'11 Hz'")
    page.page.mouse.up()
    page.page.click("#restore")
    page.until(f"{pressed}'false'")


PLACES = """["#slow", "#remedy", "#why", "#more", "#scene"].map((name) => {
  const { x, y, width } = document.querySelector(name).getBoundingClientRect();
  return [name, x, y, width];
})"""
"""Of what is pressed in the first minute."""
SLOWLY = """() => {
  const of = (query) => document.querySelector(query), { frame, canvas } = view.stage;
  if (!view.state.ended || !of("#note").textContent.startsWith("slow")) return false;
  const over = of("#over").getBoundingClientRect(), scene = canvas.getBoundingClientRect();
  const [x, y] = view.stage.toScreen(frame.handle), [right, down] = [scene.x + x, scene.y + y];
  const items = [...document.querySelectorAll("#legend li")];
  const legend = items.find((item) => item.textContent.includes("force, hand"));
  view.slowly = [...(view.slowly ?? []), {
    inside: x >= 0 && y >= 0 && x <= scene.width && y <= scene.height,
    covered: down > over.y && down < over.bottom && right < over.right,
    forces: [legend, of("[data-chart=force]")].map((each) => each.querySelector("b").textContent),
  }];
  return view.slowly.length >= 30;
}"""
"""Collects in slow motion what the picture and the plots show."""


def goes_on_when_mended(page: Page) -> None:
    """At 10 Hz a drag ends; what is said of that moves nothing, is of the run before once the next
    one runs, and the remedy that is pressed meanwhile is named as what ended it."""
    page.until("!document.getElementById('first').hidden")
    said, ended = (f"document.getElementById('{name}').innerText" for name in ("said", "ended"))
    page.page.fill("#slow", "0")
    page.until("document.getElementById('hertz').textContent === '10 Hz'")
    page.until(f"{said}.startsWith('No hand pulls')")
    places = page.get(PLACES)
    page.pull(0.02, -0.015)
    page.until(f"{ended}.startsWith('Diverged at ')")
    assert page.get(PLACES) == places
    assert "the motion grew beyond all bounds" in page.get(ended)
    assert "take a" not in page.get(ended)  # one advice
    page.page.wait_for_function(SLOWLY, timeout=60_000)
    seen = page.get("view.slowly")
    assert all(each["inside"] and not each["covered"] for each in seen)
    assert all(caption == f"hand {legend}" for legend, caption in (e["forces"] for e in seen))
    page.until(f"{ended}.startsWith('The run before diverged at ')")
    assert page.get(PLACES) == places
    page.page.mouse.up()
    assert page.get(ended).endswith("(see More).")
    page.page.click("#more summary")
    assert page.get(ended).startswith("The run before diverged at ")
    assert not page.get(ended).endswith("(see More).")  # but with its message
    page.get("document.getElementById('more').open = false")
    page.get("document.querySelector('main').scrollTo(0, 0)")
    page.pull(0.02, -0.015)
    page.until(f"{ended}.startsWith('Diverged at ')")
    page.page.mouse.up()
    page.page.click("#remedy")
    page.until("!view.state.ended && view.frame?.t > 0.1")
    assert page.get("document.getElementById('remedy').ariaPressed === 'true'")
    assert page.get(ended) == ""
    assert page.get(PLACES) == places
    page.pull(0.006, 0.012)
    page.until(f"{said}.includes('it diverged before, and the softer coupling ended that')")
    page.page.mouse.up()
    page.until(f"{said}.startsWith('No hand pulls')")
    assert page.get("document.getElementById('felt').className.trim()") == "light"
    assert page.get(PLACES) == places
    page.page.click("#restore")
    page.until("document.getElementById('remedy').ariaPressed === 'false'")


def shaken(seen: list[list[float]]) -> float:
    """The RMS (mm) of a motion above 3 Hz in the last second of times (s) and places (m)."""
    t, *place = np.array(seen).T
    even = np.arange(max(t[0], t[-1] - 2.0), t[-1], 0.01)
    fast = butter(4, 3.0, "high", fs=100, output="sos")
    moved = np.array([sosfiltfilt(fast, np.interp(even, t, each)) for each in place])
    return 1e3 * float(np.sqrt((moved[:, -100:] ** 2).sum(axis=0).mean()))
