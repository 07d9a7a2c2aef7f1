"""Presets and divergence: what the buttons change, and how the page goes on."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

import hapticlink as hl
from hapticlink.analysis.stability.hand_cases import Case
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


WORDS = {
    RATE: r"mechanism at ([\d.]+) Hz",
    "gains.controller.K_pc": r"stiffness times ([\d.]+)",
    "gains.controller.B_pc": r"damping times ([\d.]+)",
}
"""What a preset's text says of a control."""


def set_by(preset: dict[str, Any]) -> dict[str, float]:
    return {each["key"]: each["value"] for each in preset["messages"]}


def test_each_preset_differs_from_the_one_before_by_what_its_text_says(
    controls: list[dict[str, Any]],
) -> None:
    """The text of each control that it names, and of no other one."""
    offered = javascript("presets.js", "answer = presets(given);", controls)
    assert [preset["name"] for preset in offered] == ["Calm", "Buzz", "Mend it"]
    before: dict[str, float] = {}
    for preset in offered:
        now, about = set_by(preset), preset["about"]
        said = {key: re.search(words, about) for key, words in WORDS.items()}
        told = {key: float(found[1]) for key, found in said.items() if found}
        assert told == {key: value for key, value in now.items() if before.get(key) != value}
        assert before.keys() <= now.keys()  # nothing goes back to what the scene has
        before = now


def vibration(chosen: dict[str, float], away: tuple[float, float]) -> float:
    """The RMS (mm) of the handle's motion above 3 Hz, from 0.5 s on, in the mouse's hand, pulled
    away (m) for 3 s; infinite for a run that does not last."""
    given: dict[str, Any] = {RATE: chosen[RATE], "graphics.align": "tick", "packaging": "python"}
    for name, gain, own in (
        ("stiffness", "K_pc", [100.0, 100.0, 0.1]),
        ("damping", "B_pc", [20.0, 20.0, 0.02]),
    ):
        factor = chosen.get(f"gains.controller.{gain}", 1.0)
        given[f"controller.teleoperation.{name}"] = [factor * value for value in own]
    x, y = 0.0445 + away[0], 0.0148 + away[1]
    hand = {"stiffness": [100.0, 100.0, 0.0], "target": [[0.0, x, y, -0.785]]}
    pulled = {f"hand.{key}": value for key, value in hand.items()} | {"duration": 3.0}
    run = hl.run(load_viewed_scene(SERVED, given), pulled, figures=False)
    table = run.tables["haptics"]
    if table["time"][-1] < 2.9:
        return math.inf
    fast = butter(4, 3.0, "high", fs=512, output="sos")
    moved = sosfiltfilt(fast, table["haptic_device.x"][:, :2], axis=0)[256:]
    return 1e3 * float(np.sqrt((moved**2).sum(axis=1).mean()))


@pytest.mark.parametrize("away", [(-0.02, 0.0), (0.006, 0.012), (0.015, -0.015)])
def test_a_slow_mechanism_vibrates_and_a_softer_coupling_ends_it(
    controls: list[dict[str, Any]], away: tuple[float, float]
) -> None:
    """As in 36 of 36 draws of this scene, with encoders too: at least 1 mm RMS, and at most 0.4."""
    calm, buzz, mend = javascript("presets.js", "answer = presets(given);", controls)
    assert vibration(set_by(buzz), away) > 1.0
    for quiet in (calm, mend):
        assert vibration(set_by(quiet), away) < 0.4


@pytest.mark.parametrize(
    "name", ["closed-loop-ideal", "closed-loop-direct", "enclosure", "two-users", "serial"]
)
def test_buzz_is_a_vibration_that_is_seen(name: str) -> None:
    """In the mouse's hand, as the lifted map has it: it grows, at a few Hz. Mended it is stable in
    all hands, so that both lights of the page are green."""
    found, parameters = begun(name)
    _, buzz, *mended = javascript("presets.js", "answer = presets(given);", found)
    assert buzz["name"] == "Buzz"

    def judged(preset: dict[str, Any]) -> Iterator[Case]:
        settings: Settings = {RATE: 32.0} | set_by(preset)
        scaled = {
            gain: [settings.get(f"gains.{gain}", 1.0) * value for value in values]
            for gain, values in parameters.items()
        }
        scene = load_viewed_scene(name)
        return (case for case, _ in judge_hands(scene, settings, scaled))

    case = next(judged(buzz))
    assert case.growth > 1.0
    assert 5.0 < case.hertz < 30.0
    for preset in mended:
        assert {case.verdict for case in judged(preset)} == {"stable"}


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
