"""What the page shows first of a mechanism at the graphics rate: a slow one vibrates, and a softer
coupling ends that."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

import hapticlink as hl
from hapticlink.visualization.live_and_standalone.offered_controls import RATE
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from tests.visualization.browser_code.chromium import (
    COLLECT,
    Page,
    goes_on_when_mended,
    has_its_first_minute,
    shaken,
)
from tests.visualization.browser_code.javascript import javascript
from tests.visualization.browser_code.served_page import Served
from tests.visualization.live_page.viewed_controls import begun, judged, set_by

SERVED = "closed-loop-direct"
OFFERED = "answer = firstMinute(given);"
Begun = tuple[list[dict[str, Any]], dict[str, list[float]]]


@pytest.fixture(scope="module")
def of_scene() -> Begun:
    return begun(SERVED)


@pytest.fixture(scope="module")
def first(of_scene: Begun) -> dict[str, Any]:
    """What is offered."""
    found: dict[str, Any] = javascript(
        "first_minute.js", "answer = firstMinute(given);", of_scene[0]
    )
    return found


def test_the_rates_are_from_60_to_10_hz_and_the_remedy_changes_what_it_says(
    first: dict[str, Any],
) -> None:
    assert (first["rates"][0], first["rates"][-1]) == (10, 60)
    told = {
        f"gains.controller.{gain}": float(re.search(f"{word} ([0-9.]+) times", first["about"])[1])  # type: ignore[index]
        for gain, word in (("K_pc", "stiffness"), ("B_pc", "damping"))
    }
    assert set_by(first["softer"]) == told


@pytest.mark.parametrize("name", ["closed-loop-ideal", "enclosure", "sampled-spring"])
def test_a_mechanism_at_the_haptic_rate_has_none(name: str) -> None:
    controls = begun(name)[0]
    assert javascript("first_minute.js", OFFERED, controls) is None


def test_slow_it_vibrates_in_the_mouse_and_mended_it_is_stable_in_all_hands(
    of_scene: Begun, first: dict[str, Any]
) -> None:
    """As the lifted map has it, at each rate of the slider."""
    _, parameters = of_scene
    slow = next(judged(SERVED, {RATE: 11.0}, parameters))
    assert slow.growth > 1.0
    assert 5.0 < slow.hertz < 30.0
    assert next(judged(SERVED, {RATE: 60.0}, parameters)).verdict == "stable"
    for rate in first["rates"]:
        mended = judged(SERVED, {RATE: float(rate)} | set_by(first["softer"]), parameters)
        assert {case.verdict for case in mended} == {"stable"}, rate


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
    first: dict[str, Any], away: tuple[float, float]
) -> None:
    """As in 36 of 36 draws of this scene, with encoders too: at least 1 mm RMS, and at most 0.4."""
    slow = {RATE: 11.0}
    assert vibration(slow, away) > 1.0
    for quiet in ({RATE: 60.0}, slow | set_by(first["softer"])):
        assert vibration(quiet, away) < 0.4


SWUNG = """
  const swings = new Swings();
  for (let t = 0; t <= 3; t += 0.016) {
    swings.add(t, [given.drift * t, given.mm / 2e3 * Math.sin(2 * Math.PI * given.hertz * t)]);
  }
  answer = swings.vibration;
"""


@pytest.mark.parametrize(
    ("hertz", "mm", "drift", "times"),
    [(5.2, 6, 0.01, 5), (11.2, 3, 0, 11), (5, 0.9, 0, 0), (2, 30, 0, 0), (0, 0, 0.1, 0)],
)
def test_a_vibration_is_three_swings_of_a_millimetre_in_the_last_second(
    hertz: float, mm: float, drift: float, times: int
) -> None:
    """Not one that is smaller or slower, nor a drag without."""
    found = javascript("swings.js", SWUNG, {"hertz": hertz, "mm": mm, "drift": drift})
    assert (found["times"] if found else 0) == times
    if found:  # frames do not see the whole of a swing
        assert 0.8 * mm < found["mm"] <= mm


def test_the_trace_is_where_it_was_in_the_last_second() -> None:
    traced = SWUNG + "answer = swings.trace;"
    found = np.array(javascript("swings.js", traced, {"hertz": 5, "mm": 6, "drift": 0.01}))
    assert found[:, 0] == pytest.approx(0.01 * 0.016 * np.arange(188)[-len(found) :])
    assert np.ptp(found[:, 0]) == pytest.approx(0.01, abs=0.01 * 0.016)
    assert np.ptp(found[:, 1]) == pytest.approx(6e-3, rel=0.02)


def test_it_is_steady_only_in_a_hand() -> None:
    """That was watched for a second, of a run that goes on; and what vibrates by itself does so."""
    told = "answer = given.map((each) => felt(...each));"
    swings, off, on = {"times": 5, "mm": 6}, False, True
    said = {
        "No hand pulls": [None, off, True, None],
        "A second is watched first.": [None, on, False, None],
        "The handle is steady": [None, on, True, None],
        "The handle vibrates (red trace)": [swings, on, False, None],
        "No hand pulls (its damper stays)": [swings, off, True, None],
        "The run has ended": [None, on, True, "the device left its workspace"],
        "The motion grew beyond all bounds": [swings, on, True, "the run has diverged"],
    }
    found = javascript("first_minute.js", told, [*said.values()])
    assert [words.split(":")[0] for words, _ in found] == [*said]
    assert [light for _, light in found] == ["", "", "green", "red", "red", "red", "red"]


ENDED = """
  const element = { replaceChildren() {}, matches: () => false, querySelector: () => ({}) };
  const host = { querySelector: () => ({ ...element }) };
  globalThis.document = { createElement: () => ({}) };
  const page = new FirstMinute(host, () => {});
  page.begin(given.controls);
  const having = (softer, rate, alone = true) => page.show(given.controls.map((each) => {
    const soft = page.offered.softer.find(({ key }) => key === each.key);
    if (soft) return { ...each, value: softer ? soft.value : 1 };
    return each.key === page.offered.rate.key ? { ...each, value: rate } : each;
  }), alone);
  let t = 0;
  const drag = (seconds, shakes, ended = null, pulled = true) => {
    for (const end = t + seconds; t < end; t += 0.016) {
      page.add(t, { handle: [0, shakes * Math.sin(40 * t)], pulled }, null, 2);
    }
    page.add(t, { handle: [0, 0], pulled }, ended, 2);
    return page.felt.textContent;
  };
  const BEYOND = "the run has diverged";
"""
NAMES_IT = "the softer coupling ended that"


@pytest.mark.parametrize(
    ("course", "did"),
    [
        ("having(0, 11); drag(2, 3e-3); having(1, 11); drag(3, 0)", "vibrated"),
        ("having(0, 11); drag(2, 0, BEYOND); t = 0; having(1, 11); drag(3, 0)", "diverged"),
        ("having(0, 11); drag(2, 3e-3); having(1, 11); drag(0.9, 0)", ""),  # not watched yet
        ("having(0, 11); drag(2, 3e-3); having(1, 11); drag(3, 0, null, false)", ""),  # no hand
        ("having(0, 11); drag(2, 3e-3); having(1, 30); drag(3, 0)", ""),  # or the rate
        ("having(0, 11); drag(2, 0); having(1, 11); drag(3, 0)", ""),  # nothing was to end
        ("having(0, 11); drag(2, 3e-3, null, false); having(1, 11); drag(3, 0)", ""),  # in no hand
        ("having(0, 11); drag(2, 3e-3); having(1, 11); drag(3, 3e-3); drag(3, 0)", ""),  # nor ended
        ("having(0, 11); drag(2, 3e-3); having(0, 11); drag(3, 0)", ""),  # without the remedy
        ("drag(1, 3e-3); having(0, 30); drag(0.4, 3e-3); having(1, 30); drag(3, 0)", ""),
        ("having(0, 11, false); drag(2, 3e-3); having(1, 11, false); drag(3, 0)", ""),  # A or B
    ],
)
def test_the_softer_coupling_ended_it_only_where_the_same_shook_without(
    of_scene: Begun, course: str, did: str
) -> None:
    """In a hand, at the same rate and all else the same, for a second each, and not with it."""
    *before, last = course.split("; ")
    statements = f"{ENDED}{';'.join(before)}; answer = {last};"
    said = javascript("first_minute.js", statements, {"controls": of_scene[0]})
    assert (NAMES_IT in said) is bool(did)
    assert did in said


@pytest.mark.parametrize("stiffness", [1e3, 1e12])
def test_a_run_that_grew_beyond_all_bounds_is_told_so(stiffness: float) -> None:
    """By the message of its fault: an output beyond a bound, or a state that became nan."""
    gains = {"controller.teleoperation.stiffness": [stiffness, stiffness, 0.1]}
    run = hl.run(SERVED, gains | {"graphics.rate": 10}, figures=False)
    (said, _), (other, _) = javascript(
        "first_minute.js",
        "answer = given.map((why) => felt(null, [0], true, why));",
        [run.fault, "the device left its workspace"],
    )
    assert said.startswith("The motion grew beyond all bounds")
    assert other.startswith("The run has ended")


def test_a_run_that_begins_anew_has_not_swung() -> None:
    again = SWUNG + "swings.add(0, [0, 0]); answer = swings.vibration;"
    assert javascript("swings.js", again, {"hertz": 5, "mm": 6, "drift": 0}) is None


@pytest.mark.parametrize("size", [(1280, 800), (400, 800)])
def test_slowed_down_it_vibrates_until_the_remedy_is_pressed(
    served: Served, window: Callable[..., Page], size: tuple[int, int]
) -> None:
    page = window(served.url, *size)
    remedy = page.page.locator("#remedy").bounding_box()
    assert remedy["y"] + remedy["height"] <= size[1]  # nobody scrolls for it
    assert page.get("document.documentElement.scrollWidth") <= size[0]
    has_its_first_minute(page)


@pytest.mark.parametrize("size", [(1280, 800), (400, 800)])
def test_a_run_that_diverges_moves_no_control_and_is_mended(
    served: Served, window: Callable[..., Page], size: tuple[int, int]
) -> None:
    goes_on_when_mended(window(served.url, *size))


def test_more_is_folded_until_it_is_asked_for_by_a_click_or_a_link(
    served: Served, window: Callable[..., Page]
) -> None:
    page = window(served.url)
    page.until("!document.getElementById('first').hidden")
    assert not page.page.is_visible("[data-control='controller.topology']")
    page.page.click("#more summary")
    assert page.page.is_visible("[data-control='controller.topology']")
    for link, opened in (
        ("graphics.rate=20", False),
        ("graphics.rate=5", True),
        ("jitter=0", True),
    ):
        linked = window(f"{served.url}#{link}")
        linked.until(f"document.getElementById('more').open === {str(opened).lower()}")
        linked.until("!document.getElementById('first').hidden")
        assert linked.get("document.getElementById('more').open") is opened
    page.page.click("#restore")
    page.until("document.getElementById('hertz').textContent === '30 Hz'")


def test_each_control_of_the_first_minute_has_a_name(
    served: Served, window: Callable[..., Page]
) -> None:
    page = window(served.url)
    page.until("document.getElementById('hertz').textContent === '30 Hz'")
    assert page.get("document.getElementById('slow').labels[0].textContent").startswith("Rate of")
    assert page.get("document.getElementById('slow').ariaValueText") == "30 Hz"
    ids = page.get("[...document.querySelectorAll('[id]')].map((each) => each.id)")
    assert len(ids) == len({*ids})


def test_the_hold_model_begins_anew_and_ends_the_vibration_at_a_slow_rate(
    served: Served, window: Callable[..., Page]
) -> None:
    """The page says then what is so with it: why, and no remedy of gains that it counts with."""
    pressed = "document.getElementById('remedy').ariaPressed === 'true'"
    before = window(served.url)
    before.until("!document.getElementById('first').hidden")
    if before.get(pressed):  # as another test has left it
        before.page.click("#remedy")
        before.until(f"!({pressed})")
    before.page.close()
    page = window(f"{served.url}#graphics.rate=11")
    page.until("document.getElementById('hertz').textContent === '11 Hz'")
    page.page.click("#remedy")
    page.until(pressed)
    why = "document.getElementById('why').textContent"
    assert "where the linkage was" in page.get(why)
    page.page.click("#more summary")
    page.page.check("[data-control='model']")
    page.until(f"{why}.includes('where the linkage goes')")
    page.until("view.refused?.includes('gains.controller.K_pc is as in the scene')")
    assert not page.page.is_visible("#remedy")
    held = "document.querySelector(\"[data-control$='x -> controller.x_S']\").value"
    assert page.get(held) == "ahead"
    page.until("location.hash === '#graphics.rate=11&model=true'")
    page.until("view.frame?.t < 1")
    page.page.evaluate(COLLECT)
    page.pull(0.006, 0.012)
    page.until("view.frame?.t > 4")
    assert shaken(page.get("view.seen")) < 0.2
    page.page.mouse.up()
    linked = window(page.get("location.href"))
    linked.until("document.querySelector('[data-control=\"model\"]').checked")
    linked.page.close()
    page.page.click("#restore")
    page.until("location.hash === ''")
    assert page.get(held) == "zoh"
    assert page.page.is_visible("#remedy")


def test_why_has_the_rate_of_the_force_not_the_highest_of_the_linkage() -> None:
    """Which a computing_time makes lower."""
    rate = {"value": 40, "max": 50, "haptics": 512}
    said = javascript("first_minute.js", "answer = why(given, true);", rate)
    assert "computed 40 times a second, the force on the hand 512 times" in said


def test_a_handle_that_leaves_the_picture_is_taken_in() -> None:
    """With a margin of .15 of its size, and not by more than that on either side."""
    found = javascript(
        "stage.js",
        """const stage = { limits: [[0, 1], [0, 0.5]], view: { project: (at) => at } };
        const widened = (...at) => {
          Stage.prototype.include.call(stage, at.map((handle) => ({ handle })));
          return stage.limits;
        };
        answer = [widened([0.5, 0.25]), widened([0.5, 0.7], null), widened([-9, 0.25])];""",
        None,
    )
    assert found[0] == [[0, 1], [0, 0.5]]
    assert np.ravel(found[1]) == pytest.approx([0, 1, 0, 0.85])
    assert np.ravel(found[2]) == pytest.approx([-1, 1, 0, 0.85])
