"""Presets and divergence: what the buttons change, and how the page goes on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import hapticlink as hl
from hapticlink.visualization.live_and_standalone.offered_controls import RATE, Settings, target
from hapticlink.visualization.live_and_standalone.prediction import judge_hands
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from hapticlink.visualization.live_page.controls import Controls
from hapticlink.visualization.live_page.frames import FrameReader
from tests.visualization.browser_code.chromium import Page
from tests.visualization.browser_code.javascript import javascript
from tests.visualization.browser_code.served_page import Served

SERVED = "closed-loop-direct"


def begun(name: str) -> tuple[list[dict[str, Any]], dict[str, list[float]]]:
    """The controls of a scene at its start, and the parameters with which its mice hold there."""
    found: list[Any] = []

    def turn(live: hl.RealTime) -> None:
        its = Controls(live, {})
        handles = FrameReader(live).handles(live)
        held = {target(user): [*place] for user, place in handles.items()}
        found.extend((its.described(), its.parameters() | held))
        live.stop()

    hl.RealTime(load_viewed_scene(name, {"packaging": "python"})).run(turn, tables=False)
    return found[0], found[1]


@pytest.fixture(scope="module")
def controls() -> list[dict[str, Any]]:
    """Those of the scene whose mechanism runs at the graphics rate."""
    return begun("closed-loop-direct")[0]


def test_presets_are_calm_buzz_and_a_passive_hold_that_mends(
    controls: list[dict[str, Any]],
) -> None:
    """Measured of the same spring hand, 25 mm to the right: the second generates at least ten times
    what the third does."""
    calm, buzz, mend = javascript("presets.js", "answer = presets(given);", controls)
    assert calm["messages"] == [{"type": "set", "key": RATE, "value": 64}]
    options = []
    for preset in (buzz, mend):
        rate, gain, *holds = preset["messages"]
        assert (rate["key"], gain["key"]) == (RATE, "gains.controller.B_pc")
        found = {f'holds."{each["key"].removeprefix("holds.")}"': each["value"] for each in holds}
        assert {*found.values()} == {"foh" if preset is buzz else "passive"}
        damping = [20.0 * gain["value"]] * 2 + [0.02 * gain["value"]]
        found |= {"controller.teleoperation.damping": damping}
        options.append({RATE: rate["value"], **found})
    hand = {"stiffness": [100.0, 100.0, 0.0], "target": [[0.0, 0.0245, 0.0148, -0.785]]}
    peaks = []
    for chosen in options:
        scene = load_viewed_scene("closed-loop-direct", {**chosen, "packaging": "python"})
        given = {f"hand.{key}": value for key, value in hand.items()} | {"duration": 3.0}
        port = hl.run(scene, given).measures().port
        assert port
        peaks.append(port.peak)
    assert peaks[0] > 10 * peaks[1]


@pytest.mark.parametrize(
    "name", ["closed-loop-ideal", "closed-loop-direct", "enclosure", "two-users", "serial"]
)
def test_buzz_is_a_vibration_that_is_seen(name: str) -> None:
    """In the mouse's hand, as the lifted map has it: it grows, at a few Hz."""
    found, parameters = begun(name)
    chosen = javascript("presets.js", "answer = presets(given);", found)[1]
    assert chosen["name"] == "Buzz"
    settings: Settings = {RATE: 32.0} | {m["key"]: m["value"] for m in chosen["messages"]}
    for gain, values in parameters.items():
        factor = settings.get(f"gains.{gain}", 1.0)
        parameters[gain] = [factor * value for value in values]
    scene = load_viewed_scene(name, {"packaging": "python"})
    case, _ = next(judge_hands(scene, settings, parameters))
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
    page.page.click("#presets button:has-text('Calm')")
    page.until("view.map.verdict === 'stable'")
    page.page.click("#restore")
    page.until("view.map.verdict === 'unstable' && !view.map.said.endsWith('so far')")
    assert page.get("view.map.why") == before


@pytest.mark.parametrize(("press", "left"), [("ending.hide();", [2, 0]), ("", [2, 2])])
def test_what_a_run_ended_with_goes_at_a_press_and_is_read_meanwhile(
    press: str, left: list[int]
) -> None:
    """While the last moments are shown, and behind them."""
    statements = """
      globalThis.document = { createElement: () => ({}) };
      const host = { line: [], replaceChildren(...line) { this.line = line; } };
      answer = await new Promise((done) => {
        const ending = new Ending(host, () => done([meanwhile, host.line.length]));
        ending.add({ t: 1 });
        ending.show("the run has diverged");
    """
    end = "const meanwhile = host.line.length; });"
    assert javascript("ending.js", f"{statements}{press}{end}", None) == left


def test_a_run_that_diverges_is_said_shown_again_slowly_and_begins_anew(
    served: Served, window: Callable[..., Page]
) -> None:
    page = window(served.url)
    page.until("document.querySelectorAll('#presets button').length === 3")
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
    box, stage = (page.page.locator(x).bounding_box() for x in ("#ended", "#stage"))
    assert box["y"] + box["height"] <= stage["y"]  # nothing covers it
    page.until("!view.state.ended && view.frame?.t > 0.1")  # pulled on by what is still pressed
    page.page.mouse.move(400, 400, steps=2)
    page.until("Math.hypot(...view.frame.F_hand.slice(0, 2)) > 0.5")
    assert page.page.inner_text("#ended").startswith("Diverged at ")  # or of the next run
    page.page.mouse.up()
    page.page.click("#restore")
    page.until(
        "document.querySelector('[data-control=\"graphics.rate\"]').parentNode.innerText.includes('30')"
    )
    page.until("!view.state.ended")
    page.page.mouse.click(400, 400)  # the next run may have diverged before it was restored
    page.until("!document.getElementById('ended').textContent")
