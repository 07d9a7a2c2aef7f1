"""Presets and divergence: what the buttons change, and how the page goes on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from hapticlink.visualization.live_and_standalone.offered_controls import RATE
from tests.visualization.browser_code.chromium import Page
from tests.visualization.browser_code.javascript import javascript
from tests.visualization.browser_code.served_page import Served
from tests.visualization.live_page.viewed_controls import begun, judged, set_by

SERVED = "closed-loop-direct"


@pytest.fixture(scope="module")
def controls() -> list[dict[str, Any]]:
    """Those of the scene whose mechanism runs at the graphics rate."""
    return begun("closed-loop-direct")[0]


@pytest.mark.parametrize("name", ["closed-loop-ideal", "enclosure", "two-users", "serial"])
def test_buzz_is_a_vibration_that_is_seen(name: str) -> None:
    """In the mouse's hand, as the lifted map has it: it grows, at a few Hz."""
    found, parameters = begun(name)
    _, buzz = javascript("presets.js", "answer = presets(given);", found)
    assert buzz["name"] == "Buzz"
    case = next(judged(name, set_by(buzz["messages"]), parameters))
    assert case.growth > 1.0
    assert 5.0 < case.hertz < 30.0


def test_restored_is_what_differs_from_the_start(controls: list[dict[str, Any]]) -> None:
    statements = """
      const now = structuredClone(given);
      now[0].value = 12; now.at(-1).value = 3; now.find((each) => each.choices).value = "foh";
      answer = restored(now, given);
    """
    held = next(control["key"] for control in controls if "choices" in control)
    assert javascript("presets.js", statements, controls) == [
        {"type": "set", "key": key, "value": value}
        for key, value in ((RATE, 30), (held, "zoh"), (controls[-1]["key"], 1))
    ]


def test_restore_brings_back_the_verdict_of_the_start(
    served: Served, window: Callable[..., Page]
) -> None:
    """At 30 Hz, whose frames end between haptic ticks unless the rate was changed."""
    page = window(served.url)
    page.until("view.map?.verdict && !view.map.said.endsWith('so far')")
    before = page.get("view.map.why")
    page.page.fill("#slow", "22")  # 60 Hz
    page.until("view.map.verdict === 'stable'")
    page.page.click("#restore")
    page.until("view.map.verdict === 'unstable' && !view.map.said.endsWith('so far')")
    assert page.get("view.map.why") == before


SHOWN = """
  globalThis.document = { createElement: () => ({}) };
  const host = { line: [], replaceChildren(...line) { this.line = line; } };
  const said = () => host.className + host.line.map(({ textContent }) => textContent).join("");
  answer = await new Promise((done) => {
    const ending = new Ending(host, () => {
      ending.begin();
      const then = said();
      ending.begin();
      done([meanwhile, then, said(), ending.frame]);
    });
    ending.add({ t: 1 });
    ending.show("the run has diverged", given);
"""


@pytest.mark.parametrize("run", [None, "B"])
@pytest.mark.parametrize("press", [True, False])
def test_what_a_run_ended_with_goes_at_a_press_or_is_said_of_the_run_before(
    press: bool, run: str | None
) -> None:
    """Until a third one runs; while the last moments are shown it is read."""
    acts = "ending.hide();" if press else ""
    meanwhile, then, later, frame = javascript(
        "ending.js", f"{SHOWN}{acts}const meanwhile = said(); }});", run
    )
    assert meanwhile.startswith("B diverged at 1.00 s" if run else "Diverged at 1.00 s")
    before = f"before{'B of the' if run else 'The'} run before diverged at 1.00 s"
    assert then == "before" if press else then.startswith(before)
    assert later == "before"
    assert frame is None


@pytest.mark.parametrize(
    ("run", "said"), [("B", "B diverged at 1.00 s"), ("null", "Diverged at 1.00 s")]
)
def test_the_line_names_the_run_that_diverged(run: str, said: str) -> None:
    statements = """
      globalThis.document = { createElement: () => ({}) };
      const host = { replaceChildren(word) { answer = word.textContent; } };
      const ending = new Ending(host, () => {});
      ending.add({ t: 1 });
    """
    named = f"ending.show('the run has diverged', {run if run == 'null' else repr(run)});"
    assert javascript("ending.js", statements + named + "clearTimeout(ending.later);", None) == said


def test_a_run_that_diverges_is_said_shown_again_slowly_and_begins_anew(
    served: Served, window: Callable[..., Page]
) -> None:
    page = window(served.url)
    page.until("!document.getElementById('first').hidden")
    page.page.click("#more summary")
    page.page.fill("[data-control='graphics.rate']", "9")  # 10 Hz
    for port in ("x", "v"):
        name = f"holds.virtual_mechanism.{port} -> controller.{port}_S"
        page.page.select_option(f"select[data-control='{name}']", "foh")
    page.pull(0.02, -0.015)
    page.until("view.state.ended")
    said = page.page.inner_text("#ended")
    assert said.startswith("Diverged at ")
    assert "the run has diverged" in said
    assert "red" in page.get("document.getElementById('light').className")
    page.until("!view.state.ended && view.frame?.t > 0.1")  # pulled on by what is still pressed
    page.page.mouse.move(400, 400, steps=2)
    page.until("Math.hypot(...view.frame.F_hand.slice(0, 2)) > 0.5")
    assert "diverged at " in page.page.inner_text("#ended").lower()
    page.page.mouse.up()
    page.page.click("#restore")
    page.until(
        "document.querySelector('[data-control=\"graphics.rate\"]').parentNode.innerText.includes('30')"
    )
    page.until("!view.state.ended")
    page.page.mouse.click(400, 400)  # the next run may have diverged before it was restored
    page.until("!document.getElementById('ended').textContent")
